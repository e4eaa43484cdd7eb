"""The simulation setting of the thesis, 4.2.1: three tags on a circle, cameras on a sphere."""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3, so3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.dop import looking_at

FOCAL_PX = 1425.0
"""What "0.95 pixel/mm at 1500 mm" (4.2.3) amounts to."""
PANS = 40
TILTS_DEG = np.arange(5.0, 80.1, 2.5)
STEREO_BASELINE_M = 0.3

_IMAGER = Camera(2000, 2000, FOCAL_PX, FOCAL_PX, 0.0, 0.0, np.zeros(5))
PINHOLE = StereoRig(
    _IMAGER, _IMAGER, se3.from_p_R(np.array([-STEREO_BASELINE_M, 0.0, 0.0]), np.eye(3)), 1.0
)
"""The thesis's camera is its left one; the right one is for what two images would give."""

_UNIT = np.array([[0.0, 1.0, 0.0], [0.75**0.5, -0.5, 0.0], [-(0.75**0.5), -0.5, 0.0]])


def triangle(r_m: float) -> Array:
    """p_map (3, 3): the equilateral triangle of figure 4-4, on a circle of radius r_m."""
    return r_m * _UNIT


def circle(R_m: float, tilt_deg: float, pans: int = PANS) -> Array:
    """T_map_cam (pans, 4, 4) at equal angles, all looking at the middle of the tags."""
    tilt = np.deg2rad(tilt_deg)
    first = looking_at(R_m * np.array([np.sin(tilt), 0.0, np.cos(tilt)]), np.zeros(3))
    pan = np.arange(pans)[:, None] * [0.0, 0.0, 2.0 * np.pi / pans]
    turned: Array = se3.from_p_R(np.zeros((pans, 3)), so3.exp(pan)) @ first
    return turned


def peak_tilt_deg(r: float, R: float) -> float | None:
    """Where the circle of cameras meets the danger cylinder; None where it never does."""
    return float(np.rad2deg(np.arcsin(r / R))) if r <= R else None


def effective_pixel_mm(R_mm: float) -> float:
    """EPS: millimetres that one pixel takes in the plane of the tags."""
    return R_mm / FOCAL_PX
