"""Correcting a believed pose by a scene: gate, exclude, iterate."""

import math
from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import se2
from tagmap.geometry.kernels import rigid
from tagmap.localisation.fusion import Prior, chi2_bounds, every_chi2_bound
from tagmap.localisation.kernels import fusing as kernels
from tagmap.localisation.rows import rows_at
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
        cov, cross = Ad @ self.cov @ Ad.T + cov_step, np.empty_like(self.cross)
        kernels.transform(Ad, self.cross, cross)
        return Belief(self.T_map_base @ T_step, cov, cross)


def sigmas(cov: Array) -> tuple[float, float]:
    """Root of the total position variance in m, and of the total rotation variance in rad."""
    variance, d = cov.diagonal().tolist(), 3 if len(cov) == 6 else 2
    return _root(sum(variance[:d])), _root(sum(variance[d:]))


def _root(variance: float) -> float:
    return math.sqrt(variance) if variance >= 0.0 else math.nan


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
    rows, chi2 = rows_at(scene, T), np.empty(len(scene))
    kernels.against_prediction(rows.r, rows.H, rows.H_tag, belief.cov, cross, chi2)
    use: Mask = rows.valid & (chi2 <= chi2_bounds(scene.width))
    prior, start = Prior(belief.cov, cross), np.zeros(len(belief.cov))
    J = np.eye(len(start))
    if not use.any():
        return belief, use
    U = np.empty((*rows.r.shape, 2 * len(start)))
    for _ in range(MAX_STEPS):
        use = use & rows.valid
        delta, cov, gain = kernels.fuse_what_agrees(
            *(rows.r, rows.H, rows.H_tag, use, scene.width, every_chi2_bound()),
            *(prior.cov, prior.cross, start, U),
        )
        T = _stepped(T, delta)
        if np.abs(delta).max() < _SMALL_STEP or not use.any():
            break
        xi = group.log(group.inverse(belief.T_map_base) @ T)
        J = group.right_jacobian(xi)
        prior, start = Prior(J @ belief.cov @ J.T, J @ cross), -xi
        rows = rows_at(scene, T)
    after = np.empty_like(belief.cross)
    kernels.cross_after(belief.cross, scene.tag, gain, U, rows.H, rows.H_tag, J, after)
    return Belief(T, cov, after), use


def _stepped(T: Array, delta: Array) -> Array:
    """T @ exp(delta)."""
    if len(T) == 3:
        return T @ se2.exp(delta)
    moved = T.copy()
    rigid.exp_update(T, delta, moved)
    return moved
