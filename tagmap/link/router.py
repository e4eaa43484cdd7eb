"""A router in a process of its own: `python -m tagmap.link.router --listen tcp/127.0.0.1:7447`.

All routing is native code, so a process that does nothing else is as good a router as zenohd,
which reads the same files. `RouterProcess` starts one as a child that dies with its parent.
"""

import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from tagmap.errors import LinkError

if TYPE_CHECKING:
    import zenoh

START_S = 30.0
STOP_S = 5.0


class RouterProcess:
    """A router child process, at `listen` or as the file `config` says."""

    def __init__(self, listen: str | None = None, config: Path | None = None) -> None:
        if (listen is None) == (config is None):
            raise ValueError("expected either listen or config")
        self._arguments = ["--listen", listen] if listen else ["--config", str(config)]
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, timeout_s: float = START_S) -> None:
        """Return when it listens; also starts it again after it has died.

        LinkError in one line when it cannot: busy port, unusable file.
        """
        self.stop()
        command = [sys.executable, "-m", "tagmap.link.router", "--with-parent", *self._arguments]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        said = _first_line(self._process, timeout_s)
        if not said.startswith("READY"):
            self.stop()
            reason = said.removeprefix("FAILED ") or f"it did not start within {timeout_s:g} s"
            raise LinkError(f"router: {reason}")

    @property
    def pid(self) -> int:
        if self._process is None:
            raise LinkError("router: not started")
        return self._process.pid

    def poll(self) -> int | None:
        """None while it runs, else its exit status (negative: the signal that ended it)."""
        return None if self._process is None else self._process.poll()

    def stop(self, timeout_s: float = STOP_S) -> None:
        """Have it leave, as when its parent dies, or else make it. May be repeated."""
        if self._process is None:
            return
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()


def _first_line(process: subprocess.Popen[bytes], timeout_s: float) -> str:
    assert process.stdout is not None
    readable, _, _ = select.select([process.stdout], [], [], timeout_s)
    return process.stdout.readline().decode().strip() if readable else ""


def run(
    listen: list[str], config_file: Path | None, with_parent: bool, ready: Callable[[str], None]
) -> None:
    """Route until SIGTERM or, with a parent, until stdin ends. LinkError when it cannot start."""
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    # Ctrl-C reaches a whole terminal group: a child leaves when its parent is done, not before.
    signal.signal(signal.SIGINT, signal.SIG_IGN if with_parent else lambda *_: stop.set())
    if with_parent:
        threading.Thread(target=_wait_for_end_of_stdin, args=[stop], daemon=True).start()
    session, endpoints = _open(listen, config_file)
    ready(f"READY {' '.join(endpoints)}")
    stop.wait()
    session.close()  # type: ignore[no-untyped-call]


def _open(listen: list[str], config_file: Path | None) -> "tuple[zenoh.Session, list[str]]":
    import zenoh

    from tagmap.link.config import endpoints_of, one_line, router_config
    from tagmap.link.diagnosis import why_not_listening

    config = router_config(listen, config_file)
    endpoints = endpoints_of(config, "listen")
    zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]
    try:
        return zenoh.open(config), endpoints
    except zenoh.ZError as error:
        reason = why_not_listening(one_line(error))
        raise LinkError(f"cannot listen on {', '.join(endpoints)}: {reason}") from None


def _wait_for_end_of_stdin(stop: threading.Event) -> None:
    while os.read(0, 4096):
        pass
    stop.set()


def _reserve_stdout() -> Callable[[str], None]:
    """Keep stdout for the one line that is waited for; all else goes to stderr, where Zenoh's
    logs neither are mistaken for it nor fill a pipe that nobody reads."""
    stdout = os.dup(1)
    os.dup2(2, 1)

    def say(line: str) -> None:
        os.write(stdout, f"{line}\n".encode())

    return say


def main() -> None:
    import click

    @click.command(help="Route until SIGTERM. Exactly one of --listen and --config.")
    @click.option("--listen", multiple=True, help="Endpoint, as tcp/127.0.0.1:7447; repeatable.")
    @click.option("--config", type=click.Path(path_type=Path), help="Zenoh JSON5 file.")
    @click.option("--with-parent", is_flag=True, help="Leave when stdin ends; errors on stdout.")
    def command(listen: tuple[str, ...], config: Path | None, with_parent: bool) -> None:
        if bool(listen) == (config is not None):
            raise click.UsageError("expected either --listen or --config")
        say = _reserve_stdout()
        try:
            run(list(listen), config, with_parent, say)
        except LinkError as error:
            if with_parent:
                say(f"FAILED {error}")
            else:
                print(f"error: {error}", file=sys.stderr)
            sys.exit(1)

    command()


if __name__ == "__main__":
    main()
