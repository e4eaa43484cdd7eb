"""Dilution of precision by trial: noise in, the spread of the product's poses out."""

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import se3, stereo
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.dop import MM, Dop
from tagmap.localisation.pose import locate
from tagmap.localisation.view import Views, isotropic

# Noise that exact pixels are said to have, by what the tags' errors move them. With less of it the
# valleys of chi2 are so narrow that the search stops in them; with more, stereo weighs wrongly.
_EXACT_SHARE = 1e-3


def monte_carlo(
    rng: np.random.Generator,
    count: int,
    rig: StereoRig,
    p_map: Array,
    T_map_cam: Array,
    seen: Mask,
    sigma_px: float,
    sigma_tag_m: float,
) -> tuple[Dop, int]:
    """Of tags p_map (N, 3) at T_map_cam (4, 4), and how many of 2 `count` trials gave no pose.

    Of several roots the one nearest to the truth counts: this is precision, not ambiguity.
    """
    n = len(p_map)
    p_cam = se3.act(se3.inverse(T_map_cam), p_map)
    z, _ = stereo.project(rig, p_cam)
    z = np.broadcast_to(np.nan_to_num(z), (count, n, 4))
    shaken = p_map + sigma_tag_m * rng.standard_normal((count, n, 3))
    cov = np.broadcast_to(sigma_tag_m**2 * np.eye(3), (1, n, 3, 3))
    moved_px = rig.left.fx_px * sigma_tag_m / np.sqrt((p_cam * p_cam).sum(-1).mean())
    exact = isotropic(seen[None], float(_EXACT_SHARE * moved_px))
    by_tags = _errors(rig, Views(shaken, np.array(z), exact, np.array(cov)), T_map_cam)
    noisy = z + sigma_px * rng.standard_normal(z.shape)
    by_pixels = _errors(rig, Views(p_map[None], noisy, isotropic(seen[None], sigma_px)), T_map_cam)
    position, angle = _rms(by_tags)
    position_px, angle_px = _rms(by_pixels)
    found = Dop(
        position / sigma_tag_m,
        np.rad2deg(angle) / (MM * sigma_tag_m),
        position_px * MM / sigma_px,
        np.rad2deg(angle_px) / sigma_px,
    )
    return found, 2 * count - len(by_tags) - len(by_pixels)


def _errors(rig: StereoRig, views: Views, T_map_cam: Array) -> Array:
    """Tangents (M, 6) of the M <= S views with a pose: the true one as seen from the found."""
    poses = locate(rig, views)
    xi = se3.log(se3.inverse(poses.T_all) @ T_map_cam)
    size = np.nan_to_num((xi * xi).sum(-1), nan=np.inf)
    nearest = np.take_along_axis(xi, size.argmin(axis=1)[:, None, None], axis=1)[:, 0]
    return nearest[poses.n > 0]


def _rms(xi: Array) -> tuple[Array, Array]:
    square = (xi * xi).mean(axis=0) if len(xi) else np.full(6, np.nan)
    return np.sqrt(square[:3].sum()), np.sqrt(square[3] + square[4])
