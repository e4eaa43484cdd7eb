"""From a setting to a device; drivers are imported when they are configured."""

import re
from pathlib import Path

from robot_agent.laser.device import LaserDevice
from tagmap.errors import ConfigError


def open_laser(setting: str) -> LaserDevice:
    """`udp:HOST:PORT` or `file:PATH`. Hand it to an Interlock and to nobody else."""
    place = place_of(setting)
    if isinstance(place, Path):
        from robot_agent.laser.file import FileLaser

        return FileLaser(place)
    from robot_agent.laser.udp import UdpLaser

    return UdpLaser(*place)


def place_of(setting: str) -> Path | tuple[str, int]:
    """A file, or host and port. Raises ConfigError."""
    kind, _, rest = setting.partition(":")
    if kind == "file" and rest:
        return Path(rest)
    found = re.fullmatch(r"(.+):(\d{1,5})", rest)
    if kind == "udp" and found and int(found[2]) < 65536:
        return found[1], int(found[2])
    raise ConfigError(f"laser is {setting!r}, expected udp:HOST:PORT or file:PATH")
