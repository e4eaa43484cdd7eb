"""Free-running cameras in true time: what they have exposed last, rendered when somebody asks."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from fleet.simulation.world.robot import WorldRobot
from robot_agent.cameras.camera import Failure, StereoPair
from robot_agent.pan_tilt.unit import Angles

READ_NS = 30_000_000
"""From the middle of an exposure until its images are there."""
SECOND_NS = 1_000_000_000


@dataclass(slots=True)
class Exposures:
    """One every period from `start_ns` on, UTC; only the newest is kept. Times in pairs are by the
    robot's clock. After `end_ns`, where there is an end, none follows. For one caller, a
    `robot_agent` camera's server."""

    robot: WorldRobot
    start_ns: int
    angles_at: Callable[[int], Angles] | None = None
    end_ns: Callable[[], int] | None = None
    _latest_ns: int | None = None
    _latest: StereoPair | None = None

    def pairs(self, after_ns: int | None, wait_s: float) -> StereoPair | Failure | None:
        """The newest after `after_ns`, None: any; None when there is none within `wait_s`."""
        least_ns = self._after(after_ns)
        newest_ns = self._newest(time.time_ns())
        if newest_ns < least_ns:
            if self._is_over(newest_ns + self._period_ns):
                return Failure("ended", f"{self.robot.name}: the world is at its end")
            left_s = (newest_ns + self._period_ns + READ_NS - time.time_ns()) / SECOND_NS
            time.sleep(max(0.0, min(left_s, wait_s)))
            newest_ns = self._newest(time.time_ns())
            if newest_ns < least_ns:
                return None
        if newest_ns != self._latest_ns:
            self._latest = self.robot.pair(newest_ns, self.angles_at)
            self._latest_ns = newest_ns
        return self._latest

    def _after(self, after_ns: int | None) -> int:
        """The earliest time of the world that would do. Who names the pair that was given out last
        means that one, whatever clock has been set meanwhile."""
        if after_ns is None:
            return self.start_ns
        latest, latest_ns = self._latest, self._latest_ns
        if latest is not None and latest_ns is not None and after_ns == latest.t_ns:
            return latest_ns + 1
        return max(self.start_ns, self.robot.world_ns(after_ns) + 1)

    @property
    def _period_ns(self) -> int:
        return round(SECOND_NS / self.robot.table.camera_hz)

    def _newest(self, now_ns: int) -> int:
        """Middle of the newest exposure that has been read at `now_ns`, if there has been one."""
        latest_ns = now_ns - READ_NS
        if self.end_ns is not None:
            latest_ns = min(latest_ns, self.end_ns())
        return self.start_ns + (latest_ns - self.start_ns) // self._period_ns * self._period_ns

    def _is_over(self, next_ns: int) -> bool:
        return self.end_ns is not None and next_ns > self.end_ns()
