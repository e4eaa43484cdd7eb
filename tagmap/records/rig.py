"""Stereo rig calibration: the `rig.toml` of a robot, and the form in which a hello carries it."""

import math
from typing import Annotated

from msgspec import Meta

from tagmap.records.base import Finite, Positive, Record, Vector, check_finite
from tagmap.records.transform import Transform

BASELINE_M = (0.001, 10.0)
"""Least and largest distance of two cameras: less is one camera taken for two, more is mm."""


class CameraCalibration(Record, frozen=True, kw_only=True):
    """Pinhole with plumb-bob distortion, dist = [k1, k2, p1, p2, k3] (Brown 1966, OpenCV order)."""

    width_px: Annotated[int, Meta(gt=0)]
    height_px: Annotated[int, Meta(gt=0)]
    fx_px: Positive
    fy_px: Positive
    cx_px: Finite
    cy_px: Finite
    dist: Vector = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        scalars = (self.fx_px, self.fy_px, self.cx_px, self.cy_px)
        check_finite("fx_px, fy_px, cx_px, cy_px", scalars, [4])
        check_finite("dist", self.dist, [5])


class RigCalibration(Record, frozen=True, kw_only=True):
    """Two cameras; `T_right_left` takes left-camera coordinates to the right camera."""

    left: CameraCalibration
    right: CameraCalibration
    T_right_left: Transform
    sigma_px: Positive
    made: str = ""
    by: str = ""
    rms_px: Finite | None = None

    def __post_init__(self) -> None:
        if self.T_right_left.kind != "spatial":
            raise ValueError("T_right_left is planar, expected p_m of 3 and q_wxyz")
        baseline_m, (least, most) = math.hypot(*self.T_right_left.p_m), BASELINE_M
        if not least <= baseline_m <= most:
            raise ValueError(
                f"T_right_left.p_m is a baseline of {baseline_m:g} m, expected {least:g} to"
                f" {most:g} m"
            )
        check_finite("sigma_px", [self.sigma_px], [1])
