"""Laser and mirrors of the world; a window of light ends by itself, as the device's does."""

from dataclasses import dataclass

from fleet.simulation.world.laser import LaserNow
from fleet.virtual.devices.time import BOOT_NS, RobotTime
from robot_agent.laser.device import LaserDevice, Steps

SETTLING_NS = 1_000_000


@dataclass(slots=True)
class WorldLaserDevice(LaserDevice):
    time: RobotTime
    beam: LaserNow
    steps: Steps = (0, 0)

    def probe(self) -> str:
        return "simulated"

    def steer(self, steps: Steps) -> None:
        self.time.wait_ns(SETTLING_NS)
        self.steps = steps

    def light(self, until_ns: int) -> None:
        scene, now_ns = self.time.world.scene, self.time.world_ns()
        world_until_ns = until_ns - BOOT_NS + self.time.world.start_ns
        scene.shine(self.beam.name, self.beam.on(scene, self.steps), now_ns, world_until_ns)

    def dark(self) -> None:
        if not self.time.is_alive:
            return
        self.time.world.scene.shine(self.beam.name, (), self.time.world_ns())

    def close(self) -> None:
        self.dark()
