"""The first message of every agent session: who measures, with what."""

from typing import Annotated

from msgspec import Meta

from tagmap.conventions import Kind
from tagmap.records.base import (
    Message,
    Name,
    Positive,
    Record,
    RobotNumber,
    SessionId,
    check_finite,
)
from tagmap.records.rig import RigCalibration


class Limits(Record, frozen=True, kw_only=True):
    """What the robot's hardware can do; null where it has no such hardware or nobody knows."""

    reader_range_m: Positive | None = None
    write_range_m: Positive | None = None


class CalibrationSigmas(Record, frozen=True, kw_only=True):
    """How well a robot knows its own sensors: one standard deviation each; null: exactly.

    What has one becomes an unknown of this robot, which the map is solved for together with.

    `range_scale`, `stereo_scale`: of ranges and points, and of the stereo baseline (0.01: to one
    per cent), besides the scale that all robots of the site share. `disparity_px`: a constant error
    of the disparity. `principal_px`: of both principal points alike, per axis. `camera_m`,
    `camera_rad`: where the camera sits in base, per axis. `odometry_scale`, `wheel_base`: of the
    lengths and of the turns that odometry reports. `time_offset_s`: between the time stamps of
    camera and odometry.
    """

    range_scale: Positive | None = None
    stereo_scale: Positive | None = None
    disparity_px: Positive | None = None
    camera_m: Positive | None = None
    camera_rad: Positive | None = None
    odometry_scale: Positive | None = None
    wheel_base: Positive | None = None
    time_offset_s: Positive | None = None
    principal_px: Positive | None = None

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            sigma = getattr(self, name)
            if sigma is not None:
                check_finite(name, [sigma], [1])


class Introduction(Message, frozen=True, kw_only=True):
    """A hello before it is numbered: what a source says about the robot it measures from.

    `range_scale_sigma`: how well the scale of ranges and points is known (0.01: to one per cent);
    null: exactly. The scale is then an unknown that all robots of the site share.
    `stereo_scale_sigma`: likewise for the stereo baseline. `calibration`: what else this robot does
    not know exactly of its own sensors.
    """

    kind: Kind
    rig: RigCalibration | None
    limits: Limits = Limits()
    range_scale_sigma: Positive | None = None
    stereo_scale_sigma: Positive | None = None
    calibration: CalibrationSigmas = CalibrationSigmas()

    def __post_init__(self) -> None:
        for name in ("range_scale_sigma", "stereo_scale_sigma"):
            sigma = getattr(self, name)
            if sigma is not None:
                check_finite(name, [sigma], [1])


class Hello(Introduction, frozen=True, kw_only=True):
    """Seq 0 of a session."""

    site: Name
    robot: Name
    number: RobotNumber
    session: SessionId
    seq: Annotated[int, Meta(ge=0, le=0)] = 0
