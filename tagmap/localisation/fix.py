"""One-shot pose from identified sightings of mapped tags, without any earlier pose.

Agreeing distances choose the sightings to begin with, rigid alignment of their points seeds the
pose, Gauss-Newton on the measurements themselves refines it with their full covariance and that
of the tags. Then sightings that contradict the others are excluded and the rest is counted.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.geometry.alignment import align
from tagmap.localisation.consensus import consensus, points_of
from tagmap.localisation.fusion import (
    Fused,
    against_others,
    against_prediction,
    chi2_bound,
    chi2_bounds,
    fuse,
    gain_of_tags,
)
from tagmap.localisation.rows import Rows, rows_at
from tagmap.localisation.scene import Scene, lie

MAX_STEPS = 20
MAX_SIGMA_RAD = 0.3
_CONVERGED = 1e-6


@dataclass(frozen=True, slots=True)
class Fix:
    """T_map_base (D, D) with cov (dof, dof), or what is `missing` for one.

    chi2, redundancy  of the residuals and their degrees of freedom
    inliers           places of the sightings that carry the pose, in the list that was given
    cross             (N, dof, d) correlation of the pose error with each sighting's tag error
    """

    T_map_base: Array | None
    cov: Array | None
    chi2: float | None
    redundancy: int
    inliers: tuple[int, ...]
    missing: str | None
    cross: Array | None = None


def fix(scene: Scene) -> Fix:
    """Never raises: what does not determine a pose says what is missing."""
    try:
        return _fix(scene)
    except np.linalg.LinAlgError:
        return _none("sightings that determine the pose: these leave a direction open")


def _fix(scene: Scene) -> Fix:
    if not len(scene):
        return _none("a sighting of a mapped tag")
    p_base, cov_base = points_of(scene)
    agreeing = consensus(scene, p_base, cov_base)
    if missing := _too_few(scene, agreeing):
        return _none(missing)
    weights = 1.0 / np.trace(cov_base[agreeing], axis1=1, axis2=2)
    seed = align(p_base[agreeing], scene.p_map[agreeing], weights)
    if not seed.determined:
        return _none(seed.missing or "sightings that determine the pose")
    use = np.zeros(len(scene), dtype=bool)
    use[agreeing] = True
    T, fused, use = _refine_and_reject(scene, seed.T_b_a, use)
    return _judge(scene, T, fused, use)


def _refine_and_reject(scene: Scene, T: Array, use: Mask) -> tuple[Array, Fused, Mask]:
    """Refine on the agreeing points, take in all that fits their pose, exclude what does not."""
    T, fused = _refine(scene, T, use)
    rows = rows_at(scene, T)
    use = use | (against_prediction(rows, fused.cov) <= chi2_bounds(scene.width))
    T, fused = _refine(scene, T, use)
    while (worst := _worst(scene, fused, use)) is not None:
        use[worst] = False
        T, fused = _refine(scene, T, use)
    return T, fused, use


def _refine(scene: Scene, T: Array, use: Mask) -> tuple[Array, Fused]:
    """Gauss-Newton to convergence; `fused` is linearised at the last step."""
    group = lie(scene.sensor.kind)
    for _ in range(MAX_STEPS):
        fused = fuse(rows_at(scene, T).only(use), None)
        T = T @ group.exp(fused.delta)
        if np.abs(fused.delta).max() < _CONVERGED:
            break
    return T, fused


def _worst(scene: Scene, fused: Fused, use: Mask) -> int | None:
    """The sighting to exclude, while the residuals as a whole are too large."""
    if fused.chi2 <= chi2_bound(_redundancy(scene, use)):
        return None
    excess = against_others(fused, use) / chi2_bounds(scene.width)
    worst = int(np.argmax(excess))
    return worst if excess[worst] > 1.0 else None


def _judge(scene: Scene, T: Array, fused: Fused, use: Mask) -> Fix:
    """Counts and tests after rejection: only what passes is a pose."""
    rows = rows_at(scene, T).only(use)
    use = rows.valid
    carrying: Index = np.flatnonzero(use)
    redundancy = _redundancy(scene, use)
    if 2 * len(carrying) <= len(scene):
        return _none(f"agreement: only {len(carrying)} of {len(scene)} sightings fit one pose")
    if missing := _too_few(scene, carrying):
        return _none(missing)
    if fused.chi2 > chi2_bound(redundancy) and redundancy > 0:
        return _none(f"agreement: chi2 {fused.chi2:.1f} with {redundancy} degrees of freedom")
    cov, cross = _with_shared_tags(scene, fused, rows)
    d = scene.p_map.shape[1]
    sigma_rad = float(np.sqrt(np.linalg.eigvalsh(cov[d:, d:])[-1]))
    if not sigma_rad <= MAX_SIGMA_RAD:
        return _none(f"tags further apart: the orientation is open by {sigma_rad:.2f} rad")
    inliers = tuple(scene.source[carrying].tolist())
    return Fix(T, cov, fused.chi2, redundancy, inliers, None, cross)


def _with_shared_tags(scene: Scene, fused: Fused, rows: Rows) -> tuple[Array, Array]:
    """Covariance, and cross (N, dof, d), where sightings of one tag share that tag's error.

    Fusion took them as independent, K S K^T; their common part adds up before it is squared.
    """
    gained = gain_of_tags(fused, rows)
    _, place = np.unique(scene.tag, return_inverse=True)
    shared = np.zeros_like(gained)
    np.add.at(shared, place, gained)
    cov = fused.cov - _squares(gained) + _squares(shared)
    return cov, -shared[place]


def _squares(X: Array) -> Array:
    total: Array = np.einsum("nij,nkj->ik", X, X)
    return total


def _redundancy(scene: Scene, use: Mask) -> int:
    dof = 6 if scene.sensor.kind == "spatial" else 3
    return int(scene.width[use].sum()) - dof


def _too_few(scene: Scene, chosen: Index) -> str | None:
    d = scene.p_map.shape[1]
    tags = len(set(scene.tag[chosen].tolist()))
    if tags >= d:
        return None
    return f"mapped tags: {tags} with an agreeing position, at least {d} needed"


def _none(missing: str) -> Fix:
    return Fix(None, None, None, 0, (), missing)
