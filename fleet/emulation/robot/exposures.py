"""Free-running cameras in true time: what they have exposed last, rendered when somebody asks."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from fleet.simulation.world.robot import WorldRobot
from robot_agent.cameras.camera import StereoPair
from robot_agent.pan_tilt.unit import Angles

READ_NS = 30_000_000
"""From the middle of an exposure until its images are there."""
SECOND_NS = 1_000_000_000


@dataclass(slots=True)
class Exposures:
    """One every period from `start_ns` on, UTC; only the newest is kept. For one caller, a
    `robot_agent` camera's server."""

    robot: WorldRobot
    start_ns: int
    angles_at: Callable[[int], Angles] | None = None
    _latest_ns: int | None = None
    _latest: StereoPair | None = None

    def pairs(self, after_ns: int | None, wait_s: float) -> StereoPair | None:
        """The newest after `after_ns`, None: any; None when there is none within `wait_s`."""
        exposed_ns = self._exposed_ns(time.time_ns())
        if after_ns is not None and exposed_ns <= after_ns:
            left_s = (exposed_ns + self._period_ns + READ_NS - time.time_ns()) / SECOND_NS
            time.sleep(max(0.0, min(left_s, wait_s)))
            exposed_ns = self._exposed_ns(time.time_ns())
            if exposed_ns <= after_ns:
                return None
        if exposed_ns != self._latest_ns:
            self._latest = self.robot.pair(exposed_ns, self.angles_at)
            self._latest_ns = exposed_ns
        return self._latest

    @property
    def _period_ns(self) -> int:
        return round(SECOND_NS / self.robot.table.camera_hz)

    def _exposed_ns(self, now_ns: int) -> int:
        """Middle of the newest exposure that has been read at `now_ns`."""
        periods = (now_ns - READ_NS - self.start_ns) // self._period_ns
        return self.start_ns + periods * self._period_ns
