"""The clock of a robot, which is not that of the world."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RobotClock:
    """Ahead by `offset_ns` at `start_ns` of the world, and gaining `drift` of the time since.

    jumps: when, by the world, it was set by how much.
    """

    start_ns: int
    offset_ns: int
    drift: float
    jumps: tuple[tuple[int, int], ...] = ()

    def robot_ns(self, world_ns: int) -> int:
        jumped_ns = sum(by_ns for at_ns, by_ns in self.jumps if at_ns <= world_ns)
        since_ns = world_ns - self.start_ns
        return world_ns + self.offset_ns + jumped_ns + round(self.drift * since_ns)

    def world_ns(self, robot_ns: int) -> int:
        """The time at which the robot's clock says so: the last one, where it says so twice."""
        return self.all_world_ns(robot_ns)[-1]

    def all_world_ns(self, robot_ns: int) -> list[int]:
        """Every time at which it says so, in order; a clock that was set back says it twice. One
        that it never says, as it was set on, is taken as by the clock before."""
        edges = [-(2**63), *(at_ns for at_ns, _ in self.jumps), 2**63]
        found = [self._after(robot_ns, k) for k in range(len(self.jumps) + 1)]
        said = [t for k, t in enumerate(found) if edges[k] <= t < edges[k + 1]]
        return said or found[:1]

    def _after(self, robot_ns: int, k: int) -> int:
        """By the clock after its first k jumps."""
        ahead_ns = self.offset_ns + sum(by_ns for _, by_ns in self.jumps[:k])
        passed = robot_ns - ahead_ns - self.start_ns
        return self.start_ns + passed - round(self.drift / (1.0 + self.drift) * passed)
