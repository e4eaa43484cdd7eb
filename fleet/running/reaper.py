"""Ends what a killed supervisor leaves behind: nobody else would.

The other side of a pipe from the supervisor, `python -m fleet.running.reaper`: it is told the pids
of process groups, `+PID` and `-PID`, and ends those that are left when the pipe does.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import suppress

PATIENCE_S = 5.0
PAUSE_S = 0.1


class Reaper:
    """Watches from `start` to `stop`."""

    _process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "fleet.running.reaper"],
            stdin=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def watch(self, pid: int) -> None:
        self._say(f"+{pid}")

    def forget(self, pid: int) -> None:
        self._say(f"-{pid}")

    def stop(self) -> None:
        """Everybody has ended. May be repeated."""
        if self._process is not None and self._process.stdin:
            self._process.kill()
            self._process.wait()
            self._process.stdin.close()

    def _say(self, line: str) -> None:
        """Without a reaper, if somebody killed it, the run goes on all the same."""
        assert self._process is not None
        with suppress(BrokenPipeError):
            print(line, file=self._process.stdin, flush=True)


def reap(orders: Iterable[str]) -> None:
    pids: set[int] = set()
    for order in orders:
        (pids.add if order[0] == "+" else pids.discard)(int(order[1:]))
    _signal(pids, signal.SIGTERM)
    give_up_s = time.monotonic() + PATIENCE_S
    while (pids := _signal(pids, 0)) and time.monotonic() < give_up_s:
        time.sleep(PAUSE_S)
    _signal(pids, signal.SIGKILL)


def _signal(pids: Iterable[int], number: int) -> set[int]:
    """Send to the process groups; those that are there."""
    there = set()
    for pid in pids:
        with suppress(ProcessLookupError):
            os.killpg(pid, number)
            there.add(pid)
    return there


if __name__ == "__main__":
    for ignored in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ignored, signal.SIG_IGN)
    reap(sys.stdin)
