"""Bring the local maps of odometry chains into one frame, through the tags they share."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tagmap.conventions import TAG_DOF, Array, Index, Kind
from tagmap.estimation.factors import lie
from tagmap.geometry.alignment import align

MOST_SAMPLES = 300
SEED = 20


@dataclass(frozen=True, slots=True)
class LocalMap:
    """Tags as one chain sees them: tags (M,), p (M, d), sigma (M,) m, of its own frame."""

    tags: Index
    p: Array
    sigma: Array


@dataclass(frozen=True, slots=True)
class Alignment:
    """T_target_local (D, D); how many shared tags agree with it, out of how many."""

    T: Array
    agreeing: int
    shared: int


def least_shared(kind: Kind) -> int:
    """Tags that two maps must share: two in the plane, three not in line in space."""
    return TAG_DOF[kind]


def align_maps(kind: Kind, local: LocalMap, target: LocalMap) -> Alignment | None:
    """Robust rigid alignment by least median of squares (Rousseeuw 1984), then on the inliers.

    None where the shared tags do not determine it, or fewer than half of them agree.
    """
    shared, i, j = np.intersect1d(local.tags, target.tags, return_indices=True)
    if len(shared) < least_shared(kind):
        return None
    a, b = local.p[i], target.p[j]
    sigma = np.hypot(local.sigma[i], target.sigma[j])
    best: tuple[float, Array] | None = None
    for sample in _samples(len(shared), least_shared(kind)):
        fit = align(a[sample], b[sample])
        if not fit.determined:
            continue
        error = np.linalg.norm(lie(kind).act(fit.T_b_a, a) - b, axis=1) / sigma
        score = float(np.median(error))
        if best is None or score < best[0]:
            best = (score, error)
    if best is None:
        return None
    agreeing = best[1] <= max(3.0, 2.5 * 1.4826 * best[0])
    fit = align(a[agreeing], b[agreeing], sigma[agreeing] ** -2.0)
    if not fit.determined or 2 * agreeing.sum() < len(shared):
        return None
    return Alignment(fit.T_b_a, int(agreeing.sum()), len(shared))


def _samples(n: int, size: int) -> list[Index]:
    """All subsets of `size` out of n, or a fixed random choice of them."""
    every = [np.array(subset) for subset in combinations(range(min(n, 14)), size)]
    if n <= 14 and len(every) <= MOST_SAMPLES:
        return every
    rng = np.random.default_rng(SEED)
    return [rng.choice(n, size, replace=False) for _ in range(MOST_SAMPLES)]
