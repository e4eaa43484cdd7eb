"""Correcting a believed pose by a scene: gate, exclude, iterate."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.localisation.fusion import (
    Fused,
    Prior,
    against_others,
    against_prediction,
    chi2_bound,
    chi2_bounds,
    fuse,
    gain_of_tags,
)
from tagmap.localisation.rows import Rows, rows_at
from tagmap.localisation.scene import Scene, lie

MAX_STEPS = 5
# A step this small (m and rad) leaves second-order errors of 1e-4: no need to linearise again.
_SMALL_STEP = 0.01


@dataclass(frozen=True, slots=True)
class Belief:
    """T_map_base (D, D), cov (dof, dof), cross (M, dof, d) with the error of each mapped tag."""

    T_map_base: Array
    cov: Array
    cross: Array

    def moved(self, T_step: Array, Ad: Array, cov_step: Array) -> "Belief":
        """After an odometry step T_prev_cur; Ad is the adjoint of its inverse."""
        cov = Ad @ self.cov @ Ad.T + cov_step
        return Belief(self.T_map_base @ T_step, cov, Ad @ self.cross)


def sigmas(cov: Array) -> tuple[float, float]:
    """Root of the total position variance in m, and of the total rotation variance in rad."""
    variance, d = np.diagonal(cov), 3 if len(cov) == 6 else 2
    return float(np.sqrt(variance[:d].sum())), float(np.sqrt(variance[d:].sum()))


def update(scene: Scene, belief: Belief) -> tuple[Belief, Mask]:
    """The corrected belief and which sightings were accepted (N,); unchanged if none was."""
    try:
        return _update(scene, belief)
    except np.linalg.LinAlgError:
        return belief, np.zeros(len(scene), dtype=bool)


def _update(scene: Scene, belief: Belief) -> tuple[Belief, Mask]:
    """Iterated extended Kalman update (Bell and Cathey 1993) on the accepted sightings."""
    group = lie(scene.sensor.kind)
    T, cross = belief.T_map_base, belief.cross[scene.tag]
    rows = rows_at(scene, T)
    chi2 = against_prediction(rows, belief.cov, cross)
    use: Mask = chi2 <= chi2_bounds(scene.width)
    prior, start = Prior(belief.cov, cross), np.zeros(len(belief.cov))
    if not use.any():
        return belief, use
    for _ in range(MAX_STEPS):
        fused, use = _without_contradictions(scene, rows, prior, start, use)
        T = T @ group.exp(fused.delta)
        if np.abs(fused.delta).max() < _SMALL_STEP or not use.any():
            break
        xi = group.log(group.inverse(belief.T_map_base) @ T)
        J = group.right_jacobian(xi)
        prior, start = Prior(J @ belief.cov @ J.T, J @ cross), -xi
        rows = rows_at(scene, T)
    cross = _cross_after(belief, scene, rows.only(use), fused, group.right_jacobian(-start))
    return Belief(T, fused.cov, cross), use


def _without_contradictions(
    scene: Scene, rows: Rows, prior: Prior, start: Array, use: Mask
) -> tuple[Fused, Mask]:
    """Fuse; while the residuals as a whole are too large, exclude the sighting that fits worst."""
    use = use & rows.valid
    while True:
        fused = fuse(rows.only(use), prior, start)
        if fused.chi2 <= chi2_bound(int(scene.width[use].sum())):
            return fused, use
        excess = against_others(fused, use) / chi2_bounds(scene.width)
        worst = int(np.argmax(excess))
        if excess[worst] <= 1.0:
            return fused, use
        use = use.copy()
        use[worst] = False


def _cross_after(belief: Belief, scene: Scene, rows: Rows, fused: Fused, J: Array) -> Array:
    """C - K (H C + H_tag e e^T) for every mapped tag."""
    dof = len(belief.cov)
    seen_by_pose = fused.gain @ np.einsum("nkc,nkd->cd", fused.U, rows.H)
    cross: Array = (np.eye(dof) - seen_by_pose) @ J @ belief.cross
    np.subtract.at(cross, scene.tag, gain_of_tags(fused, rows))
    return cross
