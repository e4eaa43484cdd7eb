"""The devices of one robot as they are opened, and closed again in turn."""

import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from robot_agent.cameras.camera import StereoCamera
from robot_agent.devices.config import RobotConfig
from robot_agent.devices.opening import (
    mounting_of,
    open_cameras,
    open_odometer,
    open_pan_tilt,
    required_reader,
    rig_of,
    scanner_of,
)
from robot_agent.head import Head
from robot_agent.laser.clock import now_ns, second_ns
from robot_agent.laser.device import LaserDevice
from robot_agent.laser.opening import open_laser
from robot_agent.odometry.odometry import Odometer
from robot_agent.pan_tilt.mounting import Mounting
from robot_agent.pan_tilt.poller import Poller
from robot_agent.pan_tilt.unit import PanTilt, UnitInfo
from robot_agent.rfid.reader import RfidReader
from tagmap.errors import DataError
from tagmap.records.rig import RigCalibration
from tagmap.records.scanner import ScannerCalibration

UNIT_S, AGAIN_S = 10.0, 0.2
"""How long a pan-tilt unit may take to say how far it turns."""


@dataclass(frozen=True, slots=True)
class Clocks:
    """utc_ns of exposures and odometry; now_ns of leases and interlock, never jumping; second_ns
    to tell whether that one may be believed; wait_until is by now_ns."""

    utc_ns: Callable[[], int]
    now_ns: Callable[[], int]
    second_ns: Callable[[], int]
    wait_until: Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Gear:
    """What a robot has, and what its files say of it; None: it has none. unit: what `head` says
    of itself. open_laser: for an interlock, nobody else ever gets hold of one. on_turn: whom to
    tell each time that the head is seen to turn."""

    rig: RigCalibration
    cameras: StereoCamera
    mounting: Mounting
    odometer: Odometer | None
    head: Head | None
    unit: UnitInfo | None
    scanner: ScannerCalibration | None
    open_laser: Callable[[], LaserDevice] | None
    reader: RfidReader | None
    clocks: Clocks
    on_turn: Callable[[Callable[[], None]], None] | None = None


def open_gear(config: RobotConfig, path: Path, opened: ExitStack) -> Gear:
    """As configured in the file `path`, which was checked, see assembly.check. Raises ConfigError
    or DataError; whoever calls closes `opened`, whatever happens."""
    rig, cameras = rig_of(config), open_cameras(config)
    assert rig is not None
    assert cameras is not None
    opened.enter_context(closing(cameras))
    odometer = open_odometer(config)
    if odometer is not None:
        opened.enter_context(closing(odometer))
    head, unit, poller = _head(config, path, opened)
    mounting = mounting_of(config, poller)
    assert mounting is not None
    laser, reader = None, None
    if config.laser is not None:
        laser = partial(open_laser, config.laser.device)
        reader = opened.enter_context(closing(required_reader(config, path)))
        # Connects now: in the light of the first shot there is no time for that.
        reader.probe()
    clocks = Clocks(time.time_ns, now_ns, second_ns, _wait_until)
    scanner = scanner_of(config)
    return Gear(
        rig=rig,
        cameras=cameras,
        mounting=mounting,
        odometer=odometer,
        head=head,
        unit=unit,
        scanner=scanner,
        open_laser=laser,
        reader=reader,
        clocks=clocks,
        on_turn=None if poller is None else poller.on_motion,
    )


def _head(
    config: RobotConfig, path: Path, opened: ExitStack
) -> tuple[Head | None, UnitInfo | None, Poller | None]:
    """Its reach is asked of the unit at the start, which must be there then."""
    unit = open_pan_tilt(config)
    if unit is None:
        return None, None, None
    opened.enter_context(closing(unit))
    info = _about(unit, path)
    poller = opened.enter_context(Poller(unit))
    return Head(unit, poller), info, poller


def _about(unit: PanTilt, path: Path) -> UnitInfo:
    until_s = time.monotonic() + UNIT_S
    while True:
        found = unit.probe()
        if isinstance(found, UnitInfo):
            return found
        if time.monotonic() > until_s:
            raise DataError(f"{path}: the pan-tilt unit does not answer: {found.detail}")
        time.sleep(AGAIN_S)


def _wait_until(t_ns: int) -> None:
    time.sleep(max(0.0, 1e-9 * (t_ns - now_ns())))
