"""The clock of a robot, which is not that of the world."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RobotClock:
    """Ahead by `offset_ns` at `start_ns` of the world, and gaining `drift` of the time since."""

    start_ns: int
    offset_ns: int
    drift: float

    def robot_ns(self, world_ns: int) -> int:
        return world_ns + self.offset_ns + round(self.drift * (world_ns - self.start_ns))

    def world_ns(self, robot_ns: int) -> int:
        """The time at which the robot's clock says so."""
        passed = robot_ns - self.offset_ns - self.start_ns
        return self.start_ns + passed - round(self.drift / (1.0 + self.drift) * passed)
