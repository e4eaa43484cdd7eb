"""Calibration unknowns: what a robot does not know exactly of its own sensors.

    range_scale     measured / true distance of ranges and points
    stereo_scale    the same for stereo pixels: a baseline that is taken too long
    disparity_px    measured - true disparity
    camera_*        T_base_cam = T_base_cam as stated @ exp(x, y, z, rx, ry, rz), in axes of cam
    time_offset_s   the camera exposes so much later than its time stamp says
    odometry_scale  measured / true distance of odometry steps
    wheel_base      measured / true turn of odometry steps
    principal_u_px, principal_v_px  measured - true pixels, alike in both images

Each has a Gaussian prior. What no measurement feels stays at its mean, with its sigma.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from tagmap.conventions import Form, Kind

UnknownName: TypeAlias = Literal[
    "range_scale",
    "stereo_scale",
    "disparity_px",
    "camera_x_m",
    "camera_y_m",
    "camera_z_m",
    "camera_x_rad",
    "camera_y_rad",
    "camera_z_rad",
    "time_offset_s",
    "odometry_scale",
    "wheel_base",
    "principal_u_px",
    "principal_v_px",
]
NAMES: tuple[UnknownName, ...] = get_args(UnknownName)
"""The place of a name is its code in tagmap.estimation.kernels.calibration."""

SCALES: tuple[UnknownName, ...] = ("range_scale", "stereo_scale", "odometry_scale", "wheel_base")
"""About 1; the others are about 0."""

OF_EVERY_FORM: tuple[UnknownName, ...] = tuple(n for n in NAMES if n.startswith(("camera", "time")))
PRINCIPAL: tuple[UnknownName, UnknownName] = ("principal_u_px", "principal_v_px")
OF_FORM: dict[Form, tuple[UnknownName, ...]] = {
    "stereo_px": ("stereo_scale", "disparity_px", *PRINCIPAL, *OF_EVERY_FORM),
    "mono_px": (*PRINCIPAL, *OF_EVERY_FORM),
    "point_cam_m": ("range_scale", *OF_EVERY_FORM),
    "range_bearing": ("range_scale", *OF_EVERY_FORM),
}
OF_STEPS: tuple[UnknownName, UnknownName] = ("odometry_scale", "wheel_base")
CAMERA: dict[Kind, tuple[tuple[UnknownName, ...], tuple[UnknownName, ...]]] = {
    "spatial": (
        ("camera_x_m", "camera_y_m", "camera_z_m"),
        ("camera_x_rad", "camera_y_rad", "camera_z_rad"),
    ),
    "planar": (("camera_x_m", "camera_y_m"), ("camera_z_rad",)),
}
"""Offsets and turns that a camera can have in that kind of world."""


@dataclass(frozen=True, slots=True)
class Unknown:
    """One number to be solved for, and its prior. robot: None where all of the site share it."""

    name: UnknownName
    robot: str | None
    sigma: float

    @property
    def mean(self) -> float:
        return 1.0 if self.name in SCALES else 0.0

    @property
    def code(self) -> int:
        return NAMES.index(self.name)
