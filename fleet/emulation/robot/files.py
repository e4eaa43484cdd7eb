"""A robot's folder as its owner would write it: `robot.toml`, `rig.toml`, `scanner.toml`."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from fleet.simulation.world.config import config_of
from fleet.simulation.world.robot import WorldRobot
from robot_agent.cameras.network import NetworkConfig
from robot_agent.devices.config import CamerasTable, RobotConfig, read_config
from robot_agent.odometry.udp import UdpConfig
from robot_agent.rfid.llrp.driver import LlrpConfig
from tagmap.errors import ConfigError
from tagmap.records.replacing import replace_file
from tagmap.records.rig_file import write_rig
from tagmap.records.scanner_file import write_scanner

HOST = "127.0.0.1"
SHARED, LONGEST_S = {"margin_s": 0.1, "memory_s": 0.2, "write_s": 0.25}, 0.4
"""An emulated reader has the computer together with the agent, cameras and whoever else: it is late
more often than one in a box of its own."""
ROBOT, RIG, SCANNER, PAN_TILT = "robot.toml", "rig.toml", "scanner.toml", "pan-tilt"


@dataclass(frozen=True, slots=True)
class Site:
    """Where the robot is, and the number that marks the site's records in tags."""

    name: str = "site"
    number: int = 1


@dataclass(frozen=True, slots=True)
class Ports:
    """Where the robot's devices listen, and the robot for its odometry; 0: any free one."""

    cameras: int = 0
    odometry: int = 0
    laser: int = 0
    rfid: int = 0


def make_folder(folder: Path) -> None:
    """Raises ConfigError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: {error.strerror}") from None


def write_files(folder: Path, robot: WorldRobot, site: Site, ports: Ports, baud: int) -> None:
    """Raises ConfigError where they cannot be written."""
    try:
        write_rig(folder / RIG, robot.known.rig, {})
        write_scanner(folder / SCANNER, robot.known.scanner, {})
        config = with_addresses(config_of(robot, site.name, site.number), folder, ports, baud)
        replace_file(folder / ROBOT, "".join(lines(config)).encode())
    except OSError as error:
        raise ConfigError(f"{folder}: {error.strerror}") from None


def ports_before(folder: Path) -> Ports:
    """Those of the file that is there: who runs on it finds the devices where they were."""
    try:
        config = read_config(folder / ROBOT)
        assert config.cameras is not None
        assert config.cameras.network is not None
        assert config.odometry is not None
        assert config.laser is not None
        assert config.rfid is not None
        return Ports(
            config.cameras.network.port,
            config.odometry.udp.address()[1],
            int(config.laser.device.rpartition(":")[2]),
            config.rfid.llrp.port,
        )
    except (ConfigError, AssertionError, ValueError):
        return Ports()


def with_addresses(config: RobotConfig, folder: Path, ports: Ports, baud: int) -> RobotConfig:
    assert config.laser is not None
    assert config.rfid is not None
    assert config.odometry is not None
    pan_tilt = config.pan_tilt
    if pan_tilt is not None:
        port = str(folder.absolute() / PAN_TILT)
        pan_tilt = replace(pan_tilt, ptu=replace(pan_tilt.ptu, port=port, baud=baud))
    return replace(
        config,
        cameras=CamerasTable(network=NetworkConfig(host=HOST, port=ports.cameras)),
        pan_tilt=pan_tilt,
        laser=replace(config.laser, device=f"udp:{HOST}:{ports.laser}", longest_s=LONGEST_S),
        rfid=replace(config.rfid, llrp=LlrpConfig(host=HOST, port=ports.rfid)),
        odometry=replace(config.odometry, udp=UdpConfig(listen=f"{HOST}:{ports.odometry}")),
        agent=replace(config.agent, shots=replace(config.agent.shots, **SHARED)),
    )


def lines(config: RobotConfig) -> Iterator[str]:
    """TOML of what is not as it would be anyway."""
    tree = _told(config)
    for key, value in tree.items():
        if not isinstance(value, dict):
            yield f"{key} = {json.dumps(value)}\n"
    for table, values in tree.items():
        if isinstance(values, dict):
            yield f"\n[{table}]\n"
            yield from _values("", values)


def _values(prefix: str, tree: dict[str, Any]) -> Iterator[str]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _values(f"{prefix}{key}.", value)
        else:
            yield f"{prefix}{key} = {json.dumps(value)}\n"


def _told(record: msgspec.Struct) -> dict[str, Any]:
    told: dict[str, Any] = {}
    for field in msgspec.structs.fields(record):
        value = getattr(record, field.name)
        if value is not None and (field.required or value != field.default):
            is_table = isinstance(value, msgspec.Struct)
            told[field.name] = _told(value) if is_table else msgspec.to_builtins(value)
    return told
