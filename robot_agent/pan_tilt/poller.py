"""Reads the angles again and again, so that every exposure lies between two readings."""

import threading

from robot_agent.background import Background
from robot_agent.pan_tilt.track import Pointing, PointingTrack
from robot_agent.pan_tilt.unit import Failure, PanTilt, Reading

PERIOD_S = 0.03
PAUSE_S = 0.25
"""After a failure."""


class Poller(Background):
    """`with Poller(unit) as poller:` reads in a thread, while others move the unit."""

    def __init__(self, unit: PanTilt, period_s: float = PERIOD_S) -> None:
        self._unit = unit
        self._period_s = period_s
        self._track = PointingTrack()
        self._failure: Failure | None = None
        self._news = threading.Condition()
        super().__init__("pan-tilt", self._poll)

    def at(self, t_ns: int, wait_s: float = 0.0) -> Pointing | None:
        """See PointingTrack.at. The reading after `t_ns` may still be on its way: it is waited for
        no longer than `wait_s`, and not at all while the unit fails."""
        with self._news:
            self._news.wait_for(lambda: self._failure or self._track.reaches(t_ns), wait_s)
            return self._track.at(t_ns)

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
            pause_s = PAUSE_S if isinstance(reading, Failure) else self._period_s
