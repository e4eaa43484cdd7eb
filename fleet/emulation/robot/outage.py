"""A device that is away for a while."""

from dataclasses import dataclass

from fleet.emulation.robot.emulators import Device

NS = 1e9


@dataclass(frozen=True, slots=True)
class Outage:
    """Of a robot's device, from_s after the start and for_s long."""

    robot: str
    device: Device
    from_s: float
    for_s: float

    def is_on(self, passed_ns: int) -> bool:
        """Whether it lasts so long after the start."""
        return self.from_s <= passed_ns / NS < self.from_s + self.for_s
