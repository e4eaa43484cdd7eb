"""From the configuration to devices. A driver's package is imported when it is configured."""

from dataclasses import fields
from pathlib import Path

import numpy as np

from robot_agent.cameras.camera import Size, StereoCamera
from robot_agent.devices.config import Placement, RobotConfig
from robot_agent.laser.interlock import Limits
from robot_agent.odometry.odometry import Odometer
from robot_agent.odometry.wheels import Wheels
from robot_agent.pan_tilt.mounting import Angling, Fixed, Mounting, Turning
from robot_agent.pan_tilt.unit import PanTilt
from robot_agent.rfid.reader import RfidReader
from tagmap.conventions import Array
from tagmap.errors import ConfigError
from tagmap.geometry import se3
from tagmap.geometry.pan_tilt import PanTiltMount
from tagmap.records.rig import RigCalibration
from tagmap.records.rig_file import find_rig
from tagmap.records.scanner import ScannerCalibration
from tagmap.records.scanner_file import read_scanner


def rig_of(config: RobotConfig) -> RigCalibration | None:
    """Raises ConfigError."""
    return None if config.rig is None else find_rig(config.rig)


def scanner_of(config: RobotConfig) -> ScannerCalibration | None:
    """Raises ConfigError."""
    return None if config.scanner is None else read_scanner(Path(config.scanner))


def open_cameras(config: RobotConfig) -> StereoCamera | None:
    """With a rig, images of other sizes are refused. Raises ConfigError."""
    cameras, rig = config.cameras, rig_of(config)
    if cameras is None:
        return None
    expected = None if rig is None else _sizes(rig)
    if cameras.folder is not None:
        from robot_agent.cameras.folder import FolderCamera

        return FolderCamera(cameras.folder, expected)
    if cameras.network is not None:
        from robot_agent.cameras.network import NetworkCamera

        return NetworkCamera(cameras.network, expected)
    assert cameras.opencv is not None
    from robot_agent.cameras.opencv import OpenCvCamera

    return OpenCvCamera(cameras.opencv, expected)


def open_pan_tilt(config: RobotConfig) -> PanTilt | None:
    """Raises SerialUnavailable, which says what to install."""
    if config.pan_tilt is None:
        return None
    from robot_agent.pan_tilt.ptu.driver import PtuUnit

    return PtuUnit(config.pan_tilt.ptu)


def laser_limits(config: RobotConfig) -> Limits | None:
    """Of the interlock, which is all that ever holds the laser."""
    laser = config.laser
    if laser is None:
        return None
    return Limits(**{field.name: getattr(laser, field.name) for field in fields(Limits)})


def mount_of(config: RobotConfig) -> PanTiltMount | None:
    """Of cameras that are turned; see mounting_of."""
    table = config.pan_tilt
    if table is None:
        return None
    return PanTiltMount(*map(_matrix, (table.T_base_pan, table.T_pan_tilt, table.T_tilt_cam)))


def mounting_of(config: RobotConfig, poller: Angling | None) -> Mounting | None:
    """Where the camera is on the robot at any time; with a pan-tilt unit by its `poller`. None
    where nothing was configured."""
    mount = mount_of(config)
    if mount is not None and poller is not None:
        return Turning(mount, poller)
    return None if config.T_base_cam is None else Fixed(_matrix(config.T_base_cam))


def open_reader(config: RobotConfig) -> RfidReader | None:
    """Raises LlrpUnavailable, which says what to install."""
    if config.rfid is None:
        return None
    from robot_agent.rfid.llrp.driver import LlrpReader

    return LlrpReader(config.rfid.llrp)


def required_reader(config: RobotConfig, path: Path) -> RfidReader:
    """Raises ConfigError where none is configured."""
    reader = open_reader(config)
    if reader is None:
        raise ConfigError(f"{path}: no reader is configured, expected [rfid.llrp]")
    return reader


def open_odometer(config: RobotConfig) -> Odometer | None:
    """Listens from now on."""
    if config.odometry is None:
        return None
    from robot_agent.odometry.udp import UdpOdometer

    return UdpOdometer(config.odometry.udp)


def wheels_of(config: RobotConfig) -> Wheels:
    """How far odometry may be wrong; the defaults where none is configured."""
    return Wheels() if config.odometry is None else config.odometry.wheels


def _matrix(placement: Placement) -> Array:
    return se3.from_p_q(np.array(placement.p_m), np.array(placement.q_wxyz))


def _sizes(rig: RigCalibration) -> tuple[Size, Size]:
    left, right = rig.left, rig.right
    return (left.width_px, left.height_px), (right.width_px, right.height_px)
