"""Dilution of precision: by how much a place multiplies the errors that enter (thesis, 4.2).

pdop                position per tag position, m/m: sqrt(trace Cov(p)) / sigma of a tag's coordinate
odop_deg_per_mm     optical axis per tag position: its RMS angle, the turn about it excluded
ppdop_mm_per_px     position per pixel: sqrt(trace Cov(p)) / sigma of a pixel coordinate
podop_deg_per_px    optical axis per pixel

Cov is that of the best estimator. With errors of the tags only, a stereo pair measures each point
exactly, so A = I in the normal equations sum B^T A B with B = [-I, hat(p_cam)]; a single image
leaves the ray open, A = I - d d^T for a ray d. With errors of the pixels only A = J^T J.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import camera, se3, so3
from tagmap.geometry.stereo import StereoRig

MM = 1e3
_OPEN = 1e-12


@dataclass(frozen=True, slots=True)
class Dop:
    """Each (...); infinite where the tags do not determine the pose."""

    pdop: Array
    odop_deg_per_mm: Array
    ppdop_mm_per_px: Array
    podop_deg_per_px: Array


def dop(rig: StereoRig, p_map: Array, T_map_cam: Array, seen: Mask) -> Dop:
    """Of tags p_map (..., N, 3) at T_map_cam (..., 4, 4); seen (..., N, 2) by left, by right.

    A tag that is behind a camera is not seen by it.
    """
    p_cam = se3.act(se3.inverse(T_map_cam)[..., None, :, :], p_map)
    J, seen = _pixel_jacobian(rig, p_cam, seen)
    by_tags = covariance(p_cam, _by_tags(rig, p_cam, seen))
    by_pixels = covariance(p_cam, J.swapaxes(-1, -2) @ J)
    return Dop(
        spread(by_tags),
        np.rad2deg(axis_angle(by_tags)) / MM,
        spread(by_pixels) * MM,
        np.rad2deg(axis_angle(by_pixels)),
    )


def covariance(p_cam: Array, A: Array) -> Array:
    """(..., 6, 6) of points p_cam (..., N, 3) known with information A (..., N, 3, 3)."""
    B = np.concatenate([np.broadcast_to(-np.eye(3), (*p_cam.shape, 3)), so3.hat(p_cam)], axis=-1)
    H = (B.swapaxes(-1, -2) @ A @ B).sum(axis=-3)
    # Scaled to a unit diagonal, an open direction shows as an eigenvalue of rounding's size.
    scale = np.sqrt(np.maximum(np.diagonal(H, axis1=-2, axis2=-1), np.finfo(float).tiny))
    scaled = H / (scale[..., :, None] * scale[..., None, :])
    variances, axes = np.linalg.eigh(scaled)
    open_ = variances[..., :1, None] < _OPEN
    inverse = (axes / np.where(open_[..., 0], 1.0, variances)[..., None, :]) @ axes.swapaxes(-1, -2)
    inverse = inverse / (scale[..., :, None] * scale[..., None, :])
    return np.where(open_, np.inf, inverse)


def spread(cov: Array) -> Array:
    """Root of the total position variance (...), m."""
    total: Array = np.sqrt(cov[..., 0, 0] + cov[..., 1, 1] + cov[..., 2, 2])
    return total


def axis_angle(cov: Array) -> Array:
    """RMS angle (...) of the optical axis, rad: the turn about it does not count."""
    angle: Array = np.sqrt(cov[..., 3, 3] + cov[..., 4, 4])
    return angle


def _pixel_jacobian(rig: StereoRig, p_cam: Array, seen: Mask) -> tuple[Array, Mask]:
    """(..., N, 4, 3), zero where not seen."""
    with np.errstate(invalid="ignore"):
        _, J_left = camera.project(rig.left, p_cam)
        _, J_right = camera.project(rig.right, se3.act(rig.T_right_left, p_cam))
        J_right = J_right @ rig.T_right_left[:3, :3]
    real = np.isfinite([J_left.sum((-1, -2)), J_right.sum((-1, -2))])
    seen = seen & np.moveaxis(real, 0, -1)
    J = np.concatenate([J_left, J_right], axis=-2)
    return np.where(np.repeat(seen, 2, axis=-1)[..., None], J, 0.0), seen


def _by_tags(rig: StereoRig, p_cam: Array, seen: Mask) -> Array:
    """A (..., N, 3, 3) for exact pixels: which part of a tag's error they show."""
    ray = np.where(
        seen[..., :1], p_cam, se3.act(rig.T_right_left, p_cam) @ rig.T_right_left[:3, :3]
    )
    ray = ray / np.sqrt((ray * ray).sum(-1, keepdims=True))
    across = np.eye(3) - ray[..., :, None] * ray[..., None, :]
    both: Mask = np.asarray(seen.all(-1))[..., None, None]
    none: Mask = ~np.asarray(seen.any(-1))[..., None, None]
    return np.where(none, 0.0, np.where(both, np.eye(3), across))


def looking_at(p_map_cam: Array, target: Array) -> Array:
    """T_map_cam (4, 4): optical axis through `target`, image upright; straight up or down, the
    image's right is the map's x."""
    forward = target - p_map_cam
    forward = forward / np.sqrt(forward @ forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    length = np.sqrt(right @ right)
    right = right / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    return se3.from_p_R(p_map_cam, np.stack([right, np.cross(forward, right), forward], axis=-1))
