"""A pan-tilt unit that remembers where it pointed, for the cameras and the laser on it."""

import math
import threading
from bisect import bisect_right
from collections import deque

from fleet.emulation.pan_tilt.axis import STEP_S
from fleet.emulation.pan_tilt.unit import Unit
from robot_agent.pan_tilt.unit import Angles

STEP_NS = round(STEP_S * 1e9)
STEPS_PER_NOTE = 10
KEPT = 1024
ARCSEC_RAD = math.pi / 180.0 / 3600.0


class Head(Unit):
    """The unit goes on turning while nobody talks to it: also when its line is pulled out. Any
    thread may ask."""

    def __init__(self, now_ns: int) -> None:
        super().__init__()
        self._lock = threading.RLock()
        self._turned_ns = now_ns
        self._past: deque[tuple[int, float, float]] = deque(maxlen=KEPT)
        self._note()

    def receive(self, received: bytes, now_ns: int) -> list[bytes]:
        with self._lock:
            return super().receive(received, now_ns)

    def tick(self, now_ns: int) -> list[bytes]:
        with self._lock:
            self._turn(now_ns)
            # The axes have turned: for the unit no time has passed.
            self._now_ns = now_ns
            return super().tick(now_ns)

    def angles_at(self, t_ns: int) -> Angles:
        """Truly, now or a moment ago."""
        with self._lock:
            self._turn(t_ns)
            k = bisect_right(self._past, t_ns, key=lambda note: note[0])
            a, b = self._past[max(k - 1, 0)], self._past[min(k, len(self._past) - 1)]
        s = 0.0 if b[0] == a[0] else (t_ns - a[0]) / (b[0] - a[0])
        return Angles(a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]))

    def _turn(self, now_ns: int) -> None:
        """In whole steps of the axes, so that none gets lost between two calls."""
        while (steps := (now_ns - self._turned_ns) // STEP_NS) > 0:
            if all(axis.at_rest for axis in self.axes.values()):
                self._note()
                self._turned_ns += steps * STEP_NS
            else:
                passed_ns = min(steps, STEPS_PER_NOTE) * STEP_NS
                for axis in self.axes.values():
                    axis.turn(passed_ns)
                self._turned_ns += passed_ns
            self._note()

    def _note(self) -> None:
        pan_rad, tilt_rad = (
            self.axes[name].position * self.axes[name].arcsec * ARCSEC_RAD for name in "PT"
        )
        self._past.append((self._turned_ns, pan_rad, tilt_rad))
