"""Laser scanner calibration: the `scanner.toml` of a robot."""

from typing import Annotated, Literal

from msgspec import Meta

from tagmap.records.base import Finite, Positive, Record, Vector, check_covariance, check_finite
from tagmap.records.transform import Transform

UNKNOWNS = {"simplified": 7, "full": 12}
RIGHT_ANGLE_RAD = 1.5708


class MirrorCalibration(Record, frozen=True, kw_only=True):
    """Parameters of the two-mirror model, as geometry.scanner.mirrors has them."""

    separation_m: Finite
    skew_rad: Finite = 0.0
    neutral_1_rad: Finite
    neutral_2_rad: Finite
    incident_y_m: Finite = 0.0
    incident_z_m: Finite = 0.0
    incident_yaw_rad: Finite = 0.0
    incident_pitch_rad: Finite = 0.0


class DriveLimits(Record, frozen=True, kw_only=True):
    """What turns the mirrors, as geometry.scanner.drive has it: pairs are of mirrors X, Y, limits
    and spans are least and most. The defaults are a common galvo, 0.5 V per degree of its mirror,
    at a converter of 16 bits."""

    limits_x_rad: Vector = (-0.34, 0.34)
    limits_y_rad: Vector = (-0.34, 0.34)
    v_per_rad: Vector = (28.648, 28.648)
    v_at_zero: Vector = (0.0, 0.0)
    limits_v: Vector = (-10.0, 10.0)
    dac_v: Vector = (-10.0, 10.0)
    dac_bits: Annotated[int, Meta(ge=8, le=24)] = 16

    def __post_init__(self) -> None:
        check_finite("v_per_rad", self.v_per_rad, [2])
        check_finite("v_at_zero", self.v_at_zero, [2])
        if 0.0 in self.v_per_rad:
            raise ValueError(f"v_per_rad is {list(self.v_per_rad)}, expected two that are not 0")
        for name in ("limits_x_rad", "limits_y_rad", "limits_v", "dac_v"):
            span = getattr(self, name)
            check_finite(name, span, [2])
            if not span[0] < span[1]:
                raise ValueError(f"{name} is {list(span)}, expected least and most")
        for name in ("limits_x_rad", "limits_y_rad"):
            if max(map(abs, getattr(self, name))) > RIGHT_ANGLE_RAD:
                raise ValueError(f"{name} is {list(getattr(self, name))}, expected angles in rad")


class ScannerCalibration(Record, frozen=True, kw_only=True):
    """`cov`: packed upper triangle for delta in T_cam_laser @ exp(delta), then the parameters that
    the model has free: the separation; in the full model also skew and incident ray."""

    model: Literal["simplified", "full"]
    made: str = ""
    by: str = ""
    samples: Annotated[int, Meta(ge=0)] = 0
    rms_m: Finite | None = None
    sigma_theta_rad: Positive
    sigma_point_m: Positive
    cov: Vector
    T_cam_laser: Transform
    mirrors: MirrorCalibration
    drive: DriveLimits = DriveLimits()

    def __post_init__(self) -> None:
        if self.T_cam_laser.kind != "spatial":
            raise ValueError("T_cam_laser is planar, expected p_m of 3 and q_wxyz")
        check_covariance("cov", self.cov, UNKNOWNS[self.model])
