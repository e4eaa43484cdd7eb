"""Before the shot: which tags could have each other's names, and nobody would notice."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import special

from tagmap.conventions import Array, Index, Mask
from tagmap.geometry import se3, stereo
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.integrity.promise import Promise, bounds
from tagmap.localisation.pose import Doubt, Poses, locate
from tagmap.localisation.view import NOTHING, Known, Views, isotropic


@dataclass(frozen=True, slots=True)
class Exchangeable:
    """Tags i < j by their place in the list; p_unnoticed that a swap passes the chi-square test,
    which has the noncentrality `chi2`; shift_m by which the swap would move the pose, NaN: none.
    """

    i: int
    j: int
    p_unnoticed: float
    chi2: float
    shift_m: float


def swap_ambiguities(
    rig: StereoRig,
    p_map: Array,
    T_map_cam: Array,
    seen: Mask,
    sigma_px: float,
    cov_map: Array | None = None,
    known: Known = NOTHING,
    promise: Promise | None = None,
) -> list[Exchangeable]:
    """The pairs whose swap goes unnoticed with probability promise.risk or more, worst first.

    Of tags p_map (N, 3), covariance cov_map (N, 3, 3), seen (N, 2) by left, by right from
    T_map_cam (4, 4). Nothing is measured yet: this is geometry and noise alone.
    """
    promise = promise or Promise()
    pairs = np.array(list(combinations(range(len(p_map)), 2)), dtype=np.int64).reshape(-1, 2)
    if not len(pairs):
        return []
    z, _ = stereo.project(rig, se3.act(se3.inverse(T_map_cam), p_map))
    information = isotropic(seen[None], sigma_px)
    poses = locate(rig, _swapped(p_map, cov_map, z, information, pairs), known)
    chi2, p = _unnoticed(poses, promise)
    shift = np.linalg.norm(poses.T_map_cam[:, :3, 3] - T_map_cam[:3, 3], axis=-1)
    worst = np.argsort(-p, kind="stable")
    return [
        Exchangeable(int(i), int(j), float(p[k]), float(chi2[k]), float(shift[k]))
        for k, (i, j) in zip(worst, pairs[worst], strict=True)
        if p[k] >= promise.risk
    ]


def _swapped(
    p_map: Array, cov_map: Array | None, z_px: Array, information: Array, pairs: Index
) -> Views:
    """A view for each of pairs (M, 2), in which the two have each other's places on the map."""
    names = np.tile(np.arange(len(p_map)), (len(pairs), 1))
    names[np.arange(len(pairs))[:, None], pairs] = pairs[:, ::-1]
    z = np.tile(np.nan_to_num(z_px), (len(pairs), 1, 1))
    return Views(p_map[names], z, information, None if cov_map is None else cov_map[names])


def _unnoticed(poses: Poses, promise: Promise) -> tuple[Array, Array]:
    """chi2 (M,) without noise, and the probability (M,) that it passes the test with noise."""
    hopeless = (poses.doubt & Doubt.NO_ROOT) != 0
    chi2 = np.where(hopeless, np.inf, np.nan_to_num(poses.chi2))
    degrees = np.maximum(poses.dof, 1)
    passes = special.chndtr(bounds(degrees, promise.p_false_alarm), degrees, np.minimum(chi2, 1e6))
    return chi2, np.where(poses.dof > 0, np.where(hopeless, 0.0, passes), 1.0)
