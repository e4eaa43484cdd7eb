"""A thread that has the interlock look, so that a loop that hangs leaves no laser on."""

from robot_agent.background import Background
from robot_agent.laser.interlock import Interlock

EVERY_S = 0.005


class Watchdog(Background):
    """`with Watchdog(interlock): ...` Should it fail, there is no light any more."""

    def __init__(self, interlock: Interlock, every_s: float = EVERY_S) -> None:
        self._interlock, self._every_s = interlock, every_s
        super().__init__("laser-watchdog", self._watch)

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self._interlock.check()

    def _watch(self) -> None:
        try:
            while not self._stopping.wait(self._every_s):
                self._interlock.check()
        except BaseException:
            self._interlock.stop("the watchdog failed")
            raise
