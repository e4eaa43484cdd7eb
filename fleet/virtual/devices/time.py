"""The clocks of one robot of the world, and waiting by them."""

from collections.abc import Callable
from dataclasses import dataclass, field

from fleet.simulation.world.robot import WorldRobot
from fleet.simulation.world.world import World
from fleet.virtual.port import Port
from fleet.virtual.virtual_time import VirtualTime

BOOT_NS = 1_000_000_000_000


@dataclass(slots=True)
class RobotTime:
    """Waiting lets the world go on; `watchers` look at it each time it has. `port`: of the process
    that waits, which may die meanwhile; None: it cannot."""

    world: World
    robot: WorldRobot
    time: VirtualTime
    port: Port | None = None
    watchers: list[Callable[[], None]] = field(default_factory=list)

    def world_ns(self) -> int:
        return self.time.now_ns()

    def utc_ns(self) -> int:
        """What the robot takes the time of day to be."""
        return self.robot.clock_ns(self.time.now_ns())

    def now_ns(self) -> int:
        """Of a clock of the robot that never jumps."""
        return self.time.now_ns() - self.world.start_ns + BOOT_NS

    def wait_world_until(self, world_ns: int) -> None:
        if self.port is None:
            self.time.wait_until(world_ns)
        else:
            self.port.wait(lambda: False, world_ns)
        for watch in self.watchers:
            watch()

    @property
    def is_alive(self) -> bool:
        """Whom nobody has killed may still tell its devices something."""
        return self.port is None or self.port.is_open

    def wait_until(self, now_ns: int) -> None:
        """By the clock that never jumps."""
        self.wait_world_until(now_ns - BOOT_NS + self.world.start_ns)

    def wait_ns(self, ns: int) -> None:
        self.wait_world_until(self.time.now_ns() + ns)
