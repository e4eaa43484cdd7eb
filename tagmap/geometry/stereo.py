"""Two cameras fixed to each other: points to stereo pixels, and back with covariance."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.camera import Camera
from tagmap.geometry.rows import rows


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
    from tagmap.geometry.kernels import pairs

    shape = p_cam.shape[:-1]
    px, J = np.empty((*shape, 4)), np.empty((*shape, 4, 3))
    pairs.project(*_arrays(rig), rows(p_cam), px.reshape(-1, 4), J.reshape(-1, 4, 3))
    return px, J


def triangulate(rig: StereoRig, stereo_px: Array, cov: Array) -> tuple[Array, Array, Array]:
    """Most likely points p_cam (..., 3) in m, their cov (..., 3, 3), and chi2 (...) of 1 degree.

    stereo_px (..., 4) with cov (..., 4, 4) in px^2. Gauss-Newton on the reprojection error from
    the linear solution. All NaN where the rays do not meet in front of both cameras.
    """
    from tagmap.geometry.kernels import pairs

    shape, weight = stereo_px.shape[:-1], np.linalg.inv(cov)
    if cov.shape[:-2] != shape:
        shape = np.broadcast_shapes(shape, cov.shape[:-2])
        stereo_px = np.broadcast_to(stereo_px, (*shape, 4))
        weight = np.broadcast_to(weight, (*shape, 4, 4))
    z = rows(stereo_px)
    p_cam, cov_cam, chi2 = np.empty((len(z), 3)), np.empty((len(z), 3, 3)), np.empty(len(z))
    pairs.triangulate(*_arrays(rig), z, rows(weight, 4, 4), p_cam, cov_cam, chi2)
    return p_cam.reshape(*shape, 3), cov_cam.reshape(*shape, 3, 3), chi2.reshape(shape)


def _arrays(rig: StereoRig) -> tuple[Array, Array, Array]:
    return rig.left.array, rig.right.array, np.ascontiguousarray(rig.T_right_left)
