"""Whether the robot stands, and since when."""

import math
from dataclasses import dataclass

from robot_agent.odometry.datagram import Reckoned


@dataclass(frozen=True, slots=True)
class StillRules:
    """It stands when for `still_s` it has been no further than `still_m` and `still_rad` from where
    it was."""

    still_m: float = 0.002
    still_rad: float = 0.002
    still_s: float = 0.2


@dataclass(slots=True)
class Still:
    """Readings of one epoch, in the order of time."""

    rules: StillRules
    _anchor: Reckoned | None = None
    _latest_ns: int = 0

    def add(self, reading: Reckoned) -> bool:
        """True: up to now it stood, and now it has moved."""
        stood = self.since_ns is not None
        self._latest_ns = reading.t_ns
        if self._anchor is not None and not self._is_away(self._anchor, reading):
            return False
        self._anchor = reading
        return stood

    def forget(self) -> bool:
        """Nothing is known any more. True: up to now it stood."""
        stood = self.since_ns is not None
        self._anchor = None
        return stood

    @property
    def since_ns(self) -> int | None:
        """As of the latest reading."""
        anchor = self._anchor
        if anchor is None or self._latest_ns - anchor.t_ns < 1e9 * self.rules.still_s:
            return None
        return anchor.t_ns

    def _is_away(self, a: Reckoned, b: Reckoned) -> bool:
        way_m = math.hypot(b.x_m - a.x_m, b.y_m - a.y_m)
        turn_rad = abs(b.theta_rad - a.theta_rad)
        return way_m > self.rules.still_m or turn_rad > self.rules.still_rad
