"""Bring the local maps of odometry chains into one frame, through the tags they share."""

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from tagmap.conventions import TAG_DOF, Array, Index, Kind, Mask
from tagmap.estimation.problem import lie
from tagmap.geometry.alignment import align

MOST_SAMPLES = 300
MOST_JUDGES = 100
MOST_BENT = 0.1
SEED = 20


@dataclass(frozen=True, slots=True)
class LocalMap:
    """Tags as one chain sees them: tags (M,), p (M, d), sigma (M,) m, of its own frame."""

    tags: Index
    p: Array
    sigma: Array

    def take(self, keep: Mask) -> "LocalMap":
        return LocalMap(self.tags[keep], self.p[keep], self.sigma[keep])


@dataclass(frozen=True, slots=True)
class Alignment:
    """T_target_local (D, D), and how many shared tags agree with it."""

    T: Array
    agreeing: int


def least_shared(kind: Kind) -> int:
    """Tags that two maps must share: two in the plane, three not in line in space."""
    return TAG_DOF[kind]


def determines_frame(kind: Kind, local: LocalMap) -> bool:
    """Enough tags, not in line, to lay another map onto this one."""
    enough = len(local.tags) >= least_shared(kind)
    return enough and align(local.p, local.p, sigma_m=float(local.sigma.min())).determined


def align_maps(kind: Kind, local: LocalMap, target: LocalMap) -> Alignment | None:
    """Robust rigid alignment by least median of squares (Rousseeuw 1984), then on the inliers.

    None where the shared tags do not determine it, or too few agree with it: needed are all, or
    most and at least one more than fit any alignment. Local maps may be bent, so what agrees is
    judged by the errors of the better half, but never by more than MOST_BENT of the maps' size.
    """
    shared, i, j = np.intersect1d(local.tags, target.tags, return_indices=True)
    if len(shared) < least_shared(kind):
        return None
    a, b = local.p[i], target.p[j]
    sigma = np.hypot(local.sigma[i], target.sigma[j])
    T_b_a, score = _best_of_samples(kind, a, b, sigma)
    size = np.sqrt(np.square(b - b.mean(axis=0)).sum(axis=1).mean())
    bound = np.minimum(2.5 * 1.4826 * score, MOST_BENT * size / sigma)
    error = np.linalg.norm(lie(kind).act(T_b_a, a) - b, axis=1) / sigma
    agreeing = error <= np.maximum(3.0, bound)
    n = int(agreeing.sum())
    if n < len(shared) and (n <= least_shared(kind) or 2 * n <= len(shared)):
        return None
    fit = align(a[agreeing], b[agreeing], sigma[agreeing] ** -2.0, sigma.min())
    return Alignment(fit.T_b_a, n) if fit.determined else None


def _best_of_samples(kind: Kind, a: Array, b: Array, sigma: Array) -> tuple[Array, float]:
    """T_b_a (D, D) and the error that half of the points stay below, judged by MOST_JUDGES."""
    samples = _samples(len(a), least_shared(kind))
    T_b_a = _frames(b[samples]) @ lie(kind).inverse(_frames(a[samples]))
    judges: Index | slice = slice(None)
    if len(a) > MOST_JUDGES:
        judges = np.random.default_rng(SEED).permutation(len(a))[:MOST_JUDGES]
    moved = lie(kind).act(T_b_a[:, None], a[judges])
    error = np.linalg.norm(moved - b[judges], axis=2) / sigma[judges]
    covered = (error.shape[1] + least_shared(kind) + 1) // 2
    score = np.partition(error, covered - 1, axis=1)[:, covered - 1]
    score = np.where(np.isnan(error).any(axis=1), np.inf, score)
    best = int(np.argmin(score))
    return T_b_a[best], float(score[best])


def _samples(n: int, size: int) -> Index:
    """All subsets of `size` out of n, or a fixed random choice of them: (S, size)."""
    if comb(n, size) <= MOST_SAMPLES:
        return np.array(list(combinations(range(n), size)))
    order = np.random.default_rng(SEED).random((MOST_SAMPLES, n)).argsort(axis=1)
    return order[:, :size]


def _frames(p: Array) -> Array:
    """The frame (S, D, D) that the d points p (S, d, d) span: origin at their mean, x along 0-1.

    NaN where they coincide or, in space, lie on one line.
    """
    d = p.shape[-1]
    T = np.zeros((len(p), d + 1, d + 1))
    T[:, d, d] = 1.0
    T[:, :d, d] = p.mean(axis=1)
    along = p[:, 1] - p[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        x = along / np.linalg.norm(along, axis=1, keepdims=True)
        if d == 2:
            T[:, :2, 0] = x
            T[:, :2, 1] = np.stack([-x[:, 1], x[:, 0]], axis=1)
            return T
        normal = np.cross(x, p[:, 2] - p[:, 0])
        z = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = x, np.cross(z, x), z
    return T
