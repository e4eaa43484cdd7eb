"""What a robot expects to see before it looks: the priors of an identification."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.camera import undistort
from tagmap.geometry.stereo import StereoRig


@dataclass(frozen=True, slots=True)
class Expectation:
    """
    most_p_false    no spot is named with a larger probability that the whole assignment is wrong
    most_p_foreign  nor one that by itself is foreign with a larger probability
    detection       probability that a tag in the frame gives a spot
    foreign         expected number of spots that are no mapped tags
    most_foreign    so many are searched for
    unmapped        probability that the robot looks at a place that is not on the map
    likeness_m      and that repeats a mapped one to this standard deviation
    most_steps      tags looked at before the search gives up, see `search`: bounds its time
    """

    most_p_false: float = 1e-4
    most_p_foreign: float = 3e-4
    detection: float = 0.8
    foreign: float = 0.5
    most_foreign: int = 2
    unmapped: float = 1e-3
    likeness_m: float = 0.1
    most_steps: int = 80_000


@dataclass(frozen=True, slots=True)
class Frame:
    """Where both cameras see tags, in cam: x / z, y / z and z, each from and to."""

    x: tuple[float, float]
    y: tuple[float, float]
    z_m: tuple[float, float]

    @classmethod
    def of(cls, rig: StereoRig, nearest_m: float, furthest_m: float) -> "Frame":
        """What both images show of a wall at `furthest_m`, lens distortion only at mid-sides."""
        rays = undistort(rig.left, _mid_sides(rig.left.width_px, rig.left.height_px))
        left_low, left_high = _corners(rays)
        rays = undistort(rig.right, _mid_sides(rig.right.width_px, rig.right.height_px))
        wall = np.concatenate([rays, np.ones((4, 1))], axis=-1) * furthest_m
        wall = se3.act(se3.inverse(rig.T_right_left), wall)
        right_low, right_high = _corners(wall[:, :2] / wall[:, 2:])
        x, y = zip(np.maximum(left_low, right_low), np.minimum(left_high, right_high), strict=True)
        return cls((float(x[0]), float(x[1])), (float(y[0]), float(y[1])), (nearest_m, furthest_m))

    def as_array(self) -> Array:
        return np.array([*self.x, *self.y, *self.z_m])


def _mid_sides(width_px: int, height_px: int) -> Array:
    """Left, right, top, bottom (4, 2)."""
    u, v = width_px - 1.0, height_px - 1.0
    return np.array([[0.0, v / 2.0], [u, v / 2.0], [u / 2.0, 0.0], [u / 2.0, v]])


def _corners(rays: Array) -> tuple[Array, Array]:
    return np.array([rays[0, 0], rays[2, 1]]), np.array([rays[1, 0], rays[3, 1]])
