"""One child process with its output in files."""

import signal
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

STOP_S = 10.0


@dataclass(slots=True)
class Child:
    """`command` run in `folder`; stdout to NAME.out, stderr to NAME.log there.

    In a session of its own: Ctrl-C reaches only the supervisor, which ends its children in order.
    """

    name: str
    command: list[str]
    folder: Path
    started_s: float = 0.0
    _process: subprocess.Popen[bytes] | None = field(default=None, repr=False)

    def start(self) -> None:
        self.started_s = time.monotonic()
        with self.out.open("wb") as out, self.log.open("ab") as log:
            self._process = subprocess.Popen(
                self.command,
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=log,
                start_new_session=True,
            )

    @property
    def out(self) -> Path:
        return self.folder / f"{self.name}.out"

    @property
    def log(self) -> Path:
        return self.folder / f"{self.name}.log"

    @property
    def pid(self) -> int | None:
        return None if self._process is None else self._process.pid

    @property
    def status(self) -> int | None:
        """None while it runs or before it was started; negative: the signal that ended it."""
        return None if self._process is None else self._process.poll()

    def last_words(self) -> str:
        """The last line of its log, where a command says why it failed."""
        lines = self.log.read_text(errors="replace").split("\n") if self.log.exists() else []
        return next((line.strip() for line in reversed(lines) if line.strip()), "no reason given")

    def stop(self) -> None:
        """SIGTERM, then SIGKILL. May be repeated."""
        if self._process is None or self._process.poll() is not None:
            return
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
