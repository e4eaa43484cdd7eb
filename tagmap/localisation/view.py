"""What sensors see of identified tags, as arrays, and what else is known of their poses."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import se3
from tagmap.geometry.stereo import StereoRig

# A pose whose chi2 is this far above the best one's is five sigma away: no alternative any more.
ALIVE_CHI2 = 25.0


@dataclass(frozen=True, slots=True)
class Views:
    """S views of up to N tags each, seen by the two cameras of a rig, or by its left one only.

    p_map (S, N, 3)      mapped positions, m
    z_px (S, N, 4)       raw pixels (ul, vl, ur, vr); what a camera did not see may be anything
    information          (S, N, 4, 4) inverse covariance, 1 / px^2, zero rows for what was not seen
    cov_map (S, N, 3, 3) of the positions, m^2, or None where they are exact
    The last two, and p_map, may have S = 1: alike in all views.
    """

    p_map: Array
    z_px: Array
    information: Array
    cov_map: Array | None = None

    def __len__(self) -> int:
        return len(self.z_px)


def isotropic(seen: Array | Mask, sigma_px: float) -> Array:
    """information (..., N, 4, 4) for seen (..., N, 2), bool: by the left, by the right camera."""
    diagonal = np.repeat(np.asarray(seen, dtype=np.float64), 2, axis=-1) / sigma_px**2
    return diagonal[..., None] * np.eye(4)


def inverse_of(cov_px: Array, seen: Array | Mask) -> Array:
    """information (..., N, 4, 4) of cov_px (..., N, 4, 4), of which only what was `seen` counts."""
    rows = np.repeat(np.asarray(seen, dtype=bool), 2, axis=-1)
    both = rows[..., :, None] & rows[..., None, :]
    only: Array = np.where(both, cov_px, np.eye(4))
    return np.where(both, np.linalg.inv(only), 0.0)


@dataclass(frozen=True, slots=True)
class Known:
    """Prior knowledge of cam in the map; every part is optional, S or 1 in front.

    T_map_cam (S, 4, 4) with information (S, 6, 6) of its tangent (v, omega) in cam axes
    up_cam (S, 3)   the map's z axis in cam, from gravity, with sigma_up_rad
    height_m (S,)   of cam above the map's origin, with sigma_height_m
    """

    T_map_cam: Array | None = None
    information: Array | None = None
    up_cam: Array | None = None
    sigma_up_rad: float = 0.02
    height_m: Array | None = None
    sigma_height_m: float = 0.02


NOTHING = Known()


def planar_motion(T_base_cam: Array, height_m: float, sigma_m: float, sigma_rad: float) -> Known:
    """A robot that stays upright with base at `height_m`: three unknowns remain."""
    up_cam = T_base_cam[2, :3][None]
    height = np.array([height_m + T_base_cam[2, 3]])
    return Known(up_cam=up_cam, sigma_up_rad=sigma_rad, height_m=height, sigma_height_m=sigma_m)


def prior_of_base(T_map_base: Array, cov: Array, T_base_cam: Array) -> Known:
    """From a predicted T_map_base (4, 4) and its cov (6, 6), as odometry gives them."""
    Ad = se3.adjoint(se3.inverse(T_base_cam))
    information = np.asarray(np.linalg.inv(Ad @ cov @ Ad.T), dtype=np.float64)
    return Known(T_map_cam=(T_map_base @ T_base_cam)[None], information=information[None])


def as_kernel_arrays(known: Known) -> tuple[Array, Array, Array, Array]:
    """prior_T (., 3, 4), prior_information (., 6, 6), gravity (., 4), height (., 2): see View."""
    T, information = np.zeros((1, 3, 4)), np.zeros((1, 6, 6))
    gravity, height = np.zeros((1, 4)), np.zeros((1, 2))
    if known.T_map_cam is not None and known.information is not None:
        T = np.ascontiguousarray(known.T_map_cam[:, :3])
        information = np.ascontiguousarray(known.information)
    if known.up_cam is not None:
        length = np.sqrt((known.up_cam**2).sum(-1, keepdims=True))
        weight = np.full_like(length, 1.0 / known.sigma_up_rad**2)
        gravity = np.concatenate([known.up_cam / length, weight], axis=-1)
    if known.height_m is not None:
        weight = np.full_like(known.height_m, 1.0 / known.sigma_height_m**2)
        height = np.stack([known.height_m, weight], axis=-1)
    return T, information, gravity, height


def camera_arrays(rig: StereoRig) -> tuple[Array, Array, Array]:
    """left (9,), right (9,) as the kernels take them, and T_right_left (3, 4)."""
    return rig.left.array, rig.right.array, np.ascontiguousarray(rig.T_right_left[:3])
