"""Is everything there? Every configured device is asked at the same time, and none can hold up the
others."""

import math
import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

from robot_agent.cameras.camera import CameraInfo, shown_size
from robot_agent.devices.config import RobotConfig
from robot_agent.devices.opening import (
    laser_limits,
    open_cameras,
    open_odometer,
    open_pan_tilt,
    open_reader,
    rig_of,
    scanner_of,
)
from robot_agent.laser.clock import now_ns, second_ns
from robot_agent.laser.device import Steps
from robot_agent.laser.interlock import Interlock
from robot_agent.laser.opening import open_laser
from robot_agent.odometry.odometry import OdometerInfo
from robot_agent.pan_tilt.unit import UnitInfo
from robot_agent.rfid.reader import ReaderInfo
from tagmap.errors import ConfigError, DataError, TagmapError
from tagmap.memory.key_file import read_key

LIMIT_S = 10.0

Found: TypeAlias = tuple[str, str]
"""What it is, and what it says."""


@dataclass(frozen=True, slots=True)
class Checked:
    """One device. `what` is None where it did not get as far as to say."""

    device: str
    what: str | None
    ok: bool
    detail: str
    ms: float


def check(config: RobotConfig, limit_s: float = LIMIT_S) -> list[Checked]:
    """In the order of the configuration; done after `limit_s` at the latest.

    A probe that does not come back is left behind in its thread. Nothing moves and nothing shines.
    """
    started = time.monotonic()
    probes = _probes(config)
    results: dict[str, Checked] = {}
    threads = [
        threading.Thread(target=_run, args=(name, probe, results), name=name, daemon=True)
        for name, probe in probes.items()
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(max(0.0, started + limit_s - time.monotonic()))
    late = f"no answer within {limit_s:g} s"
    return [
        results.get(name, Checked(name, None, False, late, 1e3 * (time.monotonic() - started)))
        for name in probes
    ]


def _run(name: str, probe: Callable[[], Found], results: dict[str, Checked]) -> None:
    started = time.monotonic()
    what: str | None = None
    try:
        what, detail = probe()
        is_ok = True
    except TagmapError as error:
        is_ok, detail = False, str(error)
    except Exception as error:
        # One driver with a fault must not hide what the others say.
        is_ok, detail = False, f"{type(error).__name__}: {error}"
    ms = 1e3 * (time.monotonic() - started)
    results[name] = Checked(name, what, is_ok, " ".join(detail.split()), ms)


def _probes(config: RobotConfig) -> dict[str, Callable[[], Found]]:
    """What is configured."""
    known: dict[str, tuple[object, Callable[[RobotConfig], Found]]] = {
        "rig": (config.rig, _rig),
        "scanner": (config.scanner, _scanner),
        "memory key": (config.robot.memory_key, _memory_key),
        "cameras": (config.cameras, _cameras),
        "pan-tilt": (config.pan_tilt, _pan_tilt),
        "laser": (config.laser, _laser),
        "rfid": (config.rfid, _reader),
        "odometry": (config.odometry, _odometry),
    }
    return {
        name: partial(probe, config)
        for name, (configured, probe) in known.items()
        if configured is not None
    }


def _rig(config: RobotConfig) -> Found:
    rig = rig_of(config)
    assert rig is not None
    left = rig.left
    baseline_m = math.hypot(*rig.T_right_left.p_m)
    size = shown_size((left.width_px, left.height_px))
    return str(config.rig), f"{size}, baseline {baseline_m:.3f} m, sigma {rig.sigma_px:g} px"


def _scanner(config: RobotConfig) -> Found:
    scanner = scanner_of(config)
    assert scanner is not None
    return str(config.scanner), f"{scanner.model} model of {scanner.samples} samples"


def _memory_key(config: RobotConfig) -> Found:
    path = Path(str(config.robot.memory_key))
    return str(path), f"{len(read_key(path))} bytes"


def _cameras(config: RobotConfig) -> Found:
    cameras = open_cameras(config)
    assert cameras is not None
    with closing(cameras):
        found = cameras.probe()
    if not isinstance(found, CameraInfo):
        raise DataError(found.detail)
    return found.what, f"{shown_size(found.left_px)} and {shown_size(found.right_px)}"


def _pan_tilt(config: RobotConfig) -> Found:
    unit = open_pan_tilt(config)
    assert unit is not None
    with closing(unit):
        found = unit.probe()
    if not isinstance(found, UnitInfo):
        raise DataError(found.detail)
    reach = ", ".join(
        f"{name} {axis.least_rad:.2f} to {axis.most_rad:.2f} rad"
        for name, axis in (("pan", found.pan), ("tilt", found.tilt))
    )
    return found.firmware, f"{reach}, steps of {1e3 * found.pan.step_rad:.2f} mrad"


def _laser(config: RobotConfig) -> Found:
    laser, limits = config.laser, laser_limits(config)
    assert laser is not None
    assert limits is not None
    clocks = (now_ns, second_ns)
    with Interlock(open_laser(laser.device), limits, _nowhere, *clocks) as interlock:
        what = interlock.probe()
    sector = ", ".join(
        f"{name} {least:.2f} to {most:.2f} rad"
        for name, (least, most) in (
            ("bearing", limits.bearing_rad),
            ("elevation", limits.elevation_rad),
        )
    )
    return what, f"allowed: {sector}"


def _nowhere(_steps: Steps) -> tuple[float, float]:
    """So that nothing that is only probed is ever steered."""
    return math.nan, math.nan


def _reader(config: RobotConfig) -> Found:
    reader = open_reader(config)
    assert reader is not None
    with closing(reader):
        found = reader.probe()
    if not isinstance(found, ReaderInfo):
        raise DataError(found.detail)
    what = f"maker {found.manufacturer}, model {found.model}, firmware {found.firmware}"
    return what, f"at {found.address}, {found.antennas} antennas"


def _odometry(config: RobotConfig) -> Found:
    odometer = open_odometer(config)
    assert odometer is not None
    with closing(odometer):
        found = odometer.probe()
    if not isinstance(found, OdometerInfo):
        raise DataError(found.detail)
    state = "moving" if found.still_since_ns is None else "standing"
    latest = f"the latest {1e3 * found.age_s:.0f} ms old"
    return found.what, f"{found.rate_hz:.0f} readings a second, {latest}, {state}"


def require_devices(config: RobotConfig, path: Path) -> None:
    """Raise ConfigError where there is nothing to check."""
    if not _probes(config):
        raise ConfigError(f"{path}: no device is configured")
