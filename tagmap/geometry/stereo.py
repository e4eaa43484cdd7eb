"""Two cameras fixed to each other: points to stereo pixels, and back with covariance."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import camera, se3
from tagmap.geometry.camera import Camera

_STEPS = 6


@dataclass(frozen=True, slots=True)
class StereoRig:
    """`cam` is the left camera; T_right_left (4, 4); sigma_px: noise of one pixel coordinate."""

    left: Camera
    right: Camera
    T_right_left: Array
    sigma_px: float


def project(rig: StereoRig, p_cam: Array) -> tuple[Array, Array]:
    """(ul, vl, ur, vr) (..., 4) of points (..., 3) and the Jacobian (..., 4, 3) by the point.

    NaN where the point is not in front of both cameras.
    """
    left, J_left = camera.project(rig.left, p_cam)
    right, J_right = camera.project(rig.right, se3.act(rig.T_right_left, p_cam))
    J_right = J_right @ rig.T_right_left[:3, :3]
    return np.concatenate([left, right], axis=-1), np.concatenate([J_left, J_right], axis=-2)


def triangulate(rig: StereoRig, stereo_px: Array, cov: Array) -> tuple[Array, Array, Array]:
    """Most likely points p_cam (..., 3) in m, their cov (..., 3, 3), and chi2 (...) of 1 degree.

    stereo_px (..., 4) with cov (..., 4, 4) in px^2. Gauss-Newton on the reprojection error from
    the linear solution. All NaN where the rays do not meet in front of both cameras.
    """
    weight = np.linalg.inv(cov)
    with np.errstate(all="ignore"):
        p_cam = _intersect(rig, stereo_px)
        for _ in range(_STEPS):
            predicted, J = project(rig, p_cam)
            J_weight = np.swapaxes(J, -1, -2) @ weight
            cov_cam = _inverse_or_nan(J_weight @ J)
            p_cam = p_cam + (cov_cam @ J_weight @ (stereo_px - predicted)[..., None])[..., 0]
        predicted, _ = project(rig, p_cam)
        error = stereo_px - predicted
        chi2 = np.einsum("...i,...ij,...j->...", error, weight, error)
    seen = np.isfinite(chi2)
    return (
        np.where(seen[..., None], p_cam, np.nan),
        np.where(seen[..., None, None], cov_cam, np.nan),
        np.where(seen, chi2, np.nan),
    )


def _intersect(rig: StereoRig, stereo_px: Array) -> Array:
    """Least squares of the four equations x z = X, y z = Y of the two ideal rays: (..., 3)."""
    rays = (
        (camera.undistort(rig.left, stereo_px[..., :2]), np.eye(4)),
        (camera.undistort(rig.right, stereo_px[..., 2:]), rig.T_right_left),
    )
    rows = [T[:2] - ray[..., :, None] * T[2] for ray, T in rays]
    equations = np.concatenate(rows, axis=-2)
    A, b = equations[..., :3], -equations[..., 3]
    A_transposed = np.swapaxes(A, -1, -2)
    solution: Array = (_inverse_or_nan(A_transposed @ A) @ A_transposed @ b[..., None])[..., 0]
    return solution


def _inverse_or_nan(matrix: Array) -> Array:
    """Inverse of (..., 3, 3), NaN where it is singular: parallel rays meet nowhere."""
    determinant = np.linalg.det(matrix)
    singular = ~(np.abs(determinant) > 0.0)[..., None, None]
    inverse = np.linalg.inv(np.where(singular, np.eye(3), matrix))
    return np.where(singular, np.nan, inverse)
