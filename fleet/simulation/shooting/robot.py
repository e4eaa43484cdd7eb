"""One simulated robot: the agent's shots, with devices of the scene."""

from collections.abc import Callable
from dataclasses import dataclass

from fleet.simulation.scene.laser import TrueLaser
from fleet.simulation.scene.reader import SceneReader
from fleet.simulation.scene.scene import Scene
from fleet.virtual.virtual_time import VirtualTime
from robot_agent.activation.runner import Devices
from robot_agent.laser.device import LaserDevice, Steps
from robot_agent.laser.interlock import Interlock, Limits
from tagmap.records.lease import LeaseReply

SETTLING_NS = 1_000_000
EVERYWHERE = (-3.2, 3.2)
LIMITS = Limits(EVERYWHERE, EVERYWHERE)

AskService = Callable[[float, int | None, float], LeaseReply | None]


@dataclass(slots=True)
class SceneLaser(LaserDevice):
    """`offset_ns`: the robot's clock is so much ahead of the time of the scene."""

    scene: Scene
    laser: TrueLaser
    time: VirtualTime
    offset_ns: int
    steps: Steps = (0, 0)

    def probe(self) -> str:
        return "simulated"

    def steer(self, steps: Steps) -> None:
        self.time.wait_ns(SETTLING_NS)
        self.steps = steps

    def light(self, until_ns: int) -> None:
        tags = self.laser.on(self.scene, self.steps)
        now_ns = self.time.now_ns()
        self.scene.shine(self.laser.name, tags, now_ns, until_ns - self.offset_ns)

    def dark(self) -> None:
        self.scene.shine(self.laser.name, (), self.time.now_ns())

    def close(self) -> None:
        self.dark()


def devices(
    scene: Scene, laser: TrueLaser, time: VirtualTime, offset_ns: int, ask: AskService
) -> Devices:
    """Laser and reader have the robot's name."""

    def now_ns() -> int:
        return time.now_ns() + offset_ns

    device = SceneLaser(scene, laser, time, offset_ns)
    interlock = Interlock(device, LIMITS, lambda _: (0.0, 0.0), now_ns, now_ns)
    reader = SceneReader(scene.antenna(laser.name), time.now_ns, time.wait_ns)
    return Devices(interlock, reader, now_ns, lambda t_ns: time.wait_until(t_ns - offset_ns), ask)
