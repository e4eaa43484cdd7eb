"""Pinhole camera with plumb-bob distortion: points in front of it to raw pixels and back.

Model: Brown (1966), coefficients in OpenCV's order [k1, k2, p1, p2, k3]. Pixel (0, 0) is the centre
of the top-left pixel.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.rows import rows


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

    @property
    def array(self) -> Array:
        """(9,) [fx, fy, cx, cy, k1, k2, p1, p2, k3], as kernels want it."""
        return np.array([self.fx_px, self.fy_px, self.cx_px, self.cy_px, *self.dist.tolist()])


def project(camera: Camera, p_cam: Array) -> tuple[Array, Array]:
    """Raw pixels (..., 2) of points (..., 3), and their Jacobian (..., 2, 3) by the point.

    A point that is not in front of the camera (z <= 0) gives NaN. Whether the pixel lies in the
    image is not asked.
    """
    from tagmap.geometry.kernels import lens

    shape = p_cam.shape[:-1]
    px, J = np.empty((*shape, 2)), np.empty((*shape, 2, 3))
    lens.project(camera.array, rows(p_cam), px.reshape(-1, 2), J.reshape(-1, 2, 3))
    return px, J


def distort(camera: Camera, ray: Array) -> tuple[Array, Array]:
    """Distorted (x / z, y / z) (..., 2) of an ideal one, and its Jacobian (..., 2, 2)."""
    from tagmap.geometry.kernels import lens

    distorted, D = np.empty(ray.shape), np.empty((*ray.shape, 2))
    lens.distort(camera.array, rows(ray), distorted.reshape(-1, 2), D.reshape(-1, 2, 2))
    return distorted, D


def undistort(camera: Camera, px: Array) -> Array:
    """Ideal rays (x / z, y / z) (..., 2) of raw pixels; NaN where the model has no inverse."""
    from tagmap.geometry.kernels import lens

    ray = np.empty(px.shape)
    lens.undistort(camera.array, rows(px), ray.reshape(-1, 2))
    return ray
