"""The world as a child process, see world.py for the other side."""

import select
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from fleet.running.live.world import READY
from tagmap.errors import TagmapError

START_S, STOP_S, LOOK_S = 120.0, 10.0, 0.1


class WorldProcess:
    """`start` returns when all devices are there. What it says goes to `world.log` beside the plan.
    Raises TagmapError with its own reason when it ends by itself."""

    def __init__(self, plan: Path) -> None:
        self._plan = plan
        self._log = plan.parent / "world.log"
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, stopped: Callable[[], bool] = lambda: False) -> None:
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "fleet.running.live.world", str(self._plan)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                start_new_session=True,
            )
        try:
            self._wait(stopped)
        except BaseException:
            self.stop()
            raise

    def check(self) -> None:
        """That it is still there."""
        assert self._process is not None
        if self._process.poll() is not None:
            raise TagmapError(f"the world failed: {self._last_words()}")

    def end_at(self, t_ns: int) -> None:
        """Cameras say from then on that it is over; all else goes on."""
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.write(f"{t_ns}\n".encode())
            self._process.stdin.flush()

    def stop(self) -> None:
        """All devices go; memories are on the disk. May be repeated."""
        process, self._process = self._process, None
        if process is None:
            return
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(BrokenPipeError):
                    pipe.close()
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _wait(self, stopped: Callable[[], bool]) -> None:
        until_s = time.monotonic() + START_S
        while not self._is_ready() and not stopped():
            self.check()
            if time.monotonic() > until_s:
                raise TagmapError(f"the world did not start within {START_S:g} s")

    def _is_ready(self) -> bool:
        assert self._process is not None
        assert self._process.stdout is not None
        readable, _, _ = select.select([self._process.stdout], [], [], LOOK_S)
        return bool(readable) and self._process.stdout.readline().decode().strip() == READY

    def _last_words(self) -> str:
        lines = self._log.read_text(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "no reason given")
