"""What is asked of a laser with two mirrors. Only the interlock holds one."""

from typing import Protocol, TypeAlias

from tagmap.errors import TagmapError

Steps: TypeAlias = tuple[int, int]
"""Of the converters of mirrors X, Y."""


class DeviceError(TagmapError):
    """The laser or its mirrors refused, or did not answer; says which and what."""


class LaserDevice(Protocol):
    """Every call returns once the device has confirmed, or raises DeviceError. After an error what
    was asked for may have been done."""

    def probe(self) -> str:
        """One line about the device. The laser is dark afterwards."""

    def steer(self, steps: Steps) -> None:
        """Turn the mirrors, and wait until they have settled."""

    def light(self, until_ns: int) -> None:
        """Laser on. At `until_ns` of the robot's clock at the latest the device has it off by
        itself, whatever became of the program that asked, and however late the order came."""

    def dark(self) -> None:
        """Laser off."""

    def close(self) -> None:
        """Laser off as far as that is possible, and let go of the device."""
