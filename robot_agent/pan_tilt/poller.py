"""Reads the angles again and again, so that every exposure lies between two readings."""

import threading
from collections.abc import Callable

from robot_agent.background import Background
from robot_agent.pan_tilt.track import Pointing, PointingTrack
from robot_agent.pan_tilt.unit import Failure, PanTilt, Reading

PERIOD_S = 0.03
PAUSE_S = 0.25
"""After a failure."""
TURNED_RAD = 2e-3
"""More than the steps of a unit that stands."""


class Poller(Background):
    """`with Poller(unit) as poller:` reads in a thread, while others move the unit."""

    def __init__(self, unit: PanTilt, period_s: float = PERIOD_S) -> None:
        self._unit = unit
        self._period_s = period_s
        self._track = PointingTrack()
        self._failure: Failure | None = None
        self._news = threading.Condition()
        self._before: Reading | None = None
        self._callbacks: list[Callable[[], None]] = []
        super().__init__("pan-tilt", self._poll)

    def at(self, t_ns: int, wait_s: float = 0.0) -> Pointing | None:
        """See PointingTrack.at. The reading after `t_ns` may still be on its way: it is waited for
        no longer than `wait_s`, and not at all while the unit fails."""
        with self._news:
            self._news.wait_for(lambda: self._failure or self._track.reaches(t_ns), wait_s)
            return self._track.at(t_ns)

    def on_motion(self, callback: Callable[[], None]) -> None:
        """Call it each time the unit is seen to turn, whoever made it, or is seen no more. From the
        thread that reads, which waits for it: be quick."""
        self._callbacks.append(callback)

    @property
    def failure(self) -> Failure | None:
        """Why there are no new readings; None while there are."""
        with self._news:
            return self._failure

    def _poll(self) -> None:
        pause_s = 0.0
        while not self._stopping.wait(pause_s):
            reading = self._unit.read()
            with self._news:
                self._failure = reading if isinstance(reading, Failure) else None
                if isinstance(reading, Reading):
                    self._track.add(reading)
                self._news.notify_all()
            if self._has_moved(reading):
                for callback in self._callbacks:
                    callback()
            pause_s = PAUSE_S if isinstance(reading, Failure) else self._period_s

    def _has_moved(self, reading: Reading | Failure) -> bool:
        """Since the reading before, or nobody knows any more."""
        before, self._before = self._before, reading if isinstance(reading, Reading) else None
        if before is None:
            return False
        if self._before is None:
            return True
        a, b = before.angles, self._before.angles
        return max(abs(a.pan_rad - b.pan_rad), abs(a.tilt_rad - b.tilt_rad)) > TURNED_RAD
