"""What the thesis does with two images, beside reference.py, which has what it does with one."""

import numpy as np

from tagmap.conventions import Array
from tagmap.errors import DegenerateError
from tagmap.geometry import so3
from tagmap.geometry.camera import Camera, undistort
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.reference import (
    ThesisPose,
    newton_distances,
    optical_axis,
    trilaterate,
)


def reconstruct(rig: StereoRig, stereo_px: Array) -> Array:
    """p_cam (..., 3) by linear least squares of p x M P = 0 and p' x M' P = 0. Eq. 3.1."""
    rows = [
        so3.hat(_rays(model, px)) @ T[:3]
        for model, px, T in (
            (rig.left, stereo_px[..., :2], np.eye(4)),
            (rig.right, stereo_px[..., 2:], rig.T_right_left),
        )
    ]
    equations = np.concatenate(rows, axis=-2)
    A, b = equations[..., :3], -equations[..., 3:]
    solution: Array = (np.linalg.pinv(A) @ b)[..., 0]
    return solution


def left_rays(rig: StereoRig, stereo_px: Array) -> Array:
    """(..., 3) as (x, y, 1), lens undone. Eq. 4.11."""
    return _rays(rig.left, stereo_px[..., :2])


def single_image(rays: Array, p_map: Array, start_m: Array) -> Array:
    """Relative positions (3, 3), lambda n of eq. 4.11, from rays (3, 3). DegenerateError."""
    unit = rays / np.sqrt((rays**2).sum(-1, keepdims=True))
    relative: Array = newton_distances(unit, p_map, start_m)[:, None] * unit
    return relative


def pose_of(p_cam: Array, p_map: Array) -> ThesisPose:
    """Trilateration (4.4) with relative positions p_cam (3, 3), then the axis (4.22).

    Of the two mirror images the one that sees the tags in the same sense of rotation.
    """
    d = np.sqrt((p_cam**2).sum(-1))
    unit = p_cam / d[:, None]
    for p in trilaterate(p_map, d):
        if np.linalg.det(p_map - p) * np.linalg.det(unit) > 0.0:
            axis = optical_axis(p_map, p, unit)
            return ThesisPose(p, axis / np.sqrt(axis @ axis))
    raise DegenerateError("the spheres of eq. 4.4 miss each other")


def _rays(model: Camera, px: Array) -> Array:
    ideal = undistort(model, px)
    return np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1)
