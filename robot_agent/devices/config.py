"""`robot.toml`: which devices a robot has. Reading it imports no driver's package."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from robot_agent.cameras.folder import FolderConfig
from robot_agent.cameras.network import NetworkConfig
from robot_agent.cameras.opencv import OpenCvConfig
from robot_agent.laser.opening import place_of
from robot_agent.odometry.udp import UdpConfig
from robot_agent.odometry.wheels import Wheels
from robot_agent.pan_tilt.ptu.driver import PtuConfig
from robot_agent.rfid.llrp.driver import LlrpConfig
from robot_agent.settings import AgentTable
from tagmap.errors import ConfigError
from tagmap.records import toml_file
from tagmap.records.base import Finite, Name, RobotNumber
from tagmap.records.hello import CalibrationSigmas
from tagmap.records.transform import Transform

Reach: TypeAlias = Annotated[float, Meta(gt=0.0, le=1000.0)]
Sigma: TypeAlias = Annotated[float, Meta(gt=0.0, le=10.0)]
SiteNumber: TypeAlias = Annotated[int, Meta(ge=1, le=65535)]
Span: TypeAlias = tuple[
    Annotated[float, Meta(ge=-3.15, le=3.15)], Annotated[float, Meta(ge=-3.15, le=3.15)]
]
Three: TypeAlias = tuple[Finite, Finite, Finite]
Four: TypeAlias = tuple[Finite, Finite, Finite, Finite]


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the file; an unknown key is refused, for it would silently mean its default."""


class Placement(_Table, frozen=True):
    """A transform T_a_b; without `q_wxyz` b is not turned in a."""

    p_m: Three
    q_wxyz: Four = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        Transform(p_m=self.p_m, q_wxyz=self.q_wxyz)


class RobotTable(_Table, frozen=True):
    """Who this is, and on which site; `memory_key` is the file that signs what is in tags."""

    name: Name | None = None
    number: RobotNumber | None = None
    site: Name = "site"
    site_number: SiteNumber | None = None
    memory_key: str | None = None


class CamerasTable(_Table, frozen=True):
    folder: FolderConfig | None = None
    opencv: OpenCvConfig | None = None
    network: NetworkConfig | None = None

    def __post_init__(self) -> None:
        drivers = {"folder": self.folder, "opencv": self.opencv, "network": self.network}
        _require_one("cameras", drivers)


class PanTiltTable(_Table, frozen=True):
    """The three transforms are those at angles 0, see tagmap.geometry.pan_tilt."""

    ptu: PtuConfig
    T_base_pan: Placement
    T_pan_tilt: Placement
    T_tilt_cam: Placement


class LaserTable(_Table, frozen=True):
    """`device` as robot_agent.laser.opening has it, the rest as robot_agent.laser.interlock.Limits:
    the sector in base has no default."""

    device: str
    bearing_rad: Span
    elevation_rad: Span
    longest_s: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.3
    dwell_s: Annotated[float, Meta(gt=0.0, le=10.0)] = 1.0
    refill: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.5
    heartbeat_s: Annotated[float, Meta(gt=0.0, le=2.0)] = 0.5
    apart_s: Annotated[float, Meta(gt=0.0, le=0.1)] = 0.005

    def __post_init__(self) -> None:
        try:
            place_of(self.device)
        except ConfigError as error:
            raise ValueError(str(error)) from None
        for name in ("bearing_rad", "elevation_rad"):
            span = getattr(self, name)
            if not span[0] < span[1]:
                raise ValueError(f"{name} is {list(span)}, expected least and most")


class RfidTable(_Table, frozen=True):
    """How far away it hears tags, and writes them; null: nobody knows."""

    llrp: LlrpConfig
    reader_range_m: Reach | None = None
    write_range_m: Reach | None = None


class CalibrationTable(_Table, frozen=True):
    """What the robot does not know exactly of its sensors, one standard deviation each, see
    tagmap.records.hello.CalibrationSigmas: the map is solved for it as well."""

    range_scale: Sigma | None = None
    stereo_scale: Sigma | None = None
    disparity_px: Sigma | None = None
    camera_m: Sigma | None = None
    camera_rad: Sigma | None = None
    odometry_scale: Sigma | None = None
    wheel_base: Sigma | None = None
    time_offset_s: Sigma | None = None
    principal_px: Sigma | None = None

    def sigmas(self) -> CalibrationSigmas:
        return CalibrationSigmas(**{name: getattr(self, name) for name in self.__struct_fields__})


class OdometryTable(_Table, frozen=True):
    """wheels: how far what they count may be wrong."""

    udp: UdpConfig
    wheels: Wheels = Wheels()


class RobotConfig(_Table, frozen=True):
    """All of the file. rig: a file or a preset; T_base_cam: of cameras that do not turn."""

    rig: str | None = None
    scanner: str | None = None
    T_base_cam: Placement | None = None
    robot: RobotTable = RobotTable()
    cameras: CamerasTable | None = None
    pan_tilt: PanTiltTable | None = None
    laser: LaserTable | None = None
    rfid: RfidTable | None = None
    odometry: OdometryTable | None = None
    calibration: CalibrationTable = CalibrationTable()
    agent: AgentTable = AgentTable()

    def __post_init__(self) -> None:
        if self.pan_tilt is not None and self.T_base_cam is not None:
            raise ValueError(
                "T_base_cam and pan_tilt exclude each other: the unit turns the cameras"
            )


def read_config(path: Path) -> RobotConfig:
    """Raises ConfigError, which names file and key. Files in it are relative to its folder."""
    tree = toml_file.read_tree(path)
    try:
        config = msgspec.convert(tree, RobotConfig)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: {error}{_got(tree, str(error))}") from None
    return _with_places(config, path.parent)


def _got(tree: object, error: str) -> str:
    """What the file has at the key that is named in the error, where that is short."""
    found = re.search(r" - at `\$([^`]*)`$", error)
    for key, index in re.findall(r"\.(\w+)|\[(\d+)\]", found[1]) if found else ():
        try:
            tree = tree[key or int(index)]  # type: ignore[index]
        except (KeyError, IndexError, TypeError):
            return ""
    return f", got {tree!r}" if isinstance(tree, str | int | float) else ""


def _require_one(table: str, drivers: Mapping[str, object]) -> None:
    given = [name for name, config in drivers.items() if config is not None]
    if len(given) != 1:
        expected = " or ".join(f"[{table}.{name}]" for name in drivers)
        raise ValueError(f"{table} has {' and '.join(given) or 'no driver'}, expected {expected}")


def _with_places(config: RobotConfig, folder: Path) -> RobotConfig:
    """A name that is no file beside the configuration stays as it is: a preset, an address."""

    def beside(name: str | None) -> str | None:
        return str(folder / name) if name is not None and (folder / name).exists() else name

    cameras = config.cameras
    if cameras is not None and cameras.folder is not None:
        folder_config = replace(cameras.folder, folder=str(folder / cameras.folder.folder))
        cameras = replace(cameras, folder=folder_config)
    if cameras is not None and cameras.opencv is not None:
        left, right = cameras.opencv.left, cameras.opencv.right
        placed = {
            "left": beside(left) if isinstance(left, str) else left,
            "right": beside(right) if isinstance(right, str) else right,
        }
        cameras = replace(cameras, opencv=replace(cameras.opencv, **placed))
    return replace(
        config,
        rig=beside(config.rig),
        scanner=None if config.scanner is None else str(folder / config.scanner),
        cameras=cameras,
        robot=replace(config.robot, memory_key=beside(config.robot.memory_key)),
    )
