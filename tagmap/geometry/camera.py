"""Pinhole camera with plumb-bob distortion: points in front of it to raw pixels and back.

Model: Brown (1966), coefficients in OpenCV's order [k1, k2, p1, p2, k3]. Pixel (0, 0) is the centre
of the top-left pixel.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array

_UNDISTORT_STEPS = 10
_UNDISTORT_TOLERANCE = 1e-10


@dataclass(frozen=True, slots=True)
class Camera:
    """Intrinsics in px; dist (5,) without unit."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    dist: Array

    @property
    def focal_px(self) -> Array:
        return np.array([self.fx_px, self.fy_px])

    @property
    def centre_px(self) -> Array:
        return np.array([self.cx_px, self.cy_px])


def project(camera: Camera, p_cam: Array) -> tuple[Array, Array]:
    """Raw pixels (..., 2) of points (..., 3), and their Jacobian (..., 2, 3) by the point.

    A point that is not in front of the camera (z <= 0) gives NaN. Whether the pixel lies in the
    image is not asked.
    """
    z = np.where(p_cam[..., 2] > 0.0, p_cam[..., 2], np.nan)[..., None]
    ray = p_cam[..., :2] / z
    distorted, D = distort(camera, ray)
    focal = camera.focal_px
    J_ray = focal[:, None] * D / z[..., None]
    J_depth = -(J_ray @ ray[..., None])
    return camera.centre_px + focal * distorted, np.concatenate([J_ray, J_depth], axis=-1)


def distort(camera: Camera, ray: Array) -> tuple[Array, Array]:
    """Distorted (x / z, y / z) (..., 2) of an ideal one, and its Jacobian (..., 2, 2)."""
    k1, k2, p1, p2, k3 = camera.dist
    x, y = ray[..., 0], ray[..., 1]
    xy, r2 = x * y, x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    distorted = np.stack(
        [
            x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * xy,
        ],
        axis=-1,
    )
    D = np.empty((*ray.shape, 2))
    D[..., 0, 0] = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    D[..., 1, 1] = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    D[..., 0, 1] = D[..., 1, 0] = slope * xy + 2.0 * (p1 * x + p2 * y)
    return distorted, D


def undistort(camera: Camera, px: Array) -> Array:
    """Ideal rays (x / z, y / z) (..., 2) of raw pixels; NaN where the model has no inverse."""
    target = (px - camera.centre_px) / camera.focal_px
    ray = target
    if not camera.dist.any():
        return ray
    with np.errstate(all="ignore"):
        for _ in range(_UNDISTORT_STEPS):
            distorted, D = distort(camera, ray)
            ray = ray - _solve_2x2(D, distorted - target)
        distorted, D = distort(camera, ray)
        error = np.abs(distorted - target).max(axis=-1, keepdims=True)
        # Past the fold of the radial polynomial a second, mirrored solution lies in wait.
        folded = (D[..., 0, 0] * D[..., 1, 1] <= D[..., 0, 1] ** 2)[..., None]
        return np.where((error < _UNDISTORT_TOLERANCE) & ~folded, ray, np.nan)


def _solve_2x2(D: Array, right: Array) -> Array:
    a, b, d = D[..., 0, 0], D[..., 0, 1], D[..., 1, 1]
    u, v = right[..., 0], right[..., 1]
    return np.stack([d * u - b * v, a * v - b * u], axis=-1) / (a * d - b * b)[..., None]
