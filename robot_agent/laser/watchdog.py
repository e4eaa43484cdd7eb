"""A thread that has the interlock look, so that a loop that hangs leaves no laser on."""

import threading
from types import TracebackType

from robot_agent.laser.interlock import Interlock

EVERY_S = 0.005


class Watchdog:
    """`with Watchdog(interlock): ...`"""

    def __init__(self, interlock: Interlock, every_s: float = EVERY_S) -> None:
        self._interlock, self._every_s = interlock, every_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="laser-watchdog", daemon=True)

    def __enter__(self) -> "Watchdog":
        self._thread.start()
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self._ended.set()
        self._thread.join()
        self._interlock.check()

    def _watch(self) -> None:
        while not self._ended.wait(self._every_s):
            self._interlock.check()
