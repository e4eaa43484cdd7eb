"""From a start to the nearest optimum, with the promise that goes with it."""

import math
from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels import normal
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.rigid import copy, exp_update
from tagmap.localisation.kernels.scene import View, linearise

_MAX_STEPS = 25
# A step that gains less chi2 than this moves the pose by 0.3 sigma; what it leaves is of second
# order in that.
_LAST_GAIN = 0.1
_MOST_DAMPING = 1e8
_POWERS = 10


class Desk(NamedTuple):
    """Room to work: H, trial_H, L, scratch (6, 6); g, trial_g, delta (6,); T_trial (3, 4)."""

    H: Array
    trial_H: Array
    L: Array
    scratch: Array
    g: Array
    trial_g: Array
    delta: Array
    T_trial: Array


@compiled
def new_desk() -> Desk:
    square, line = np.zeros((4, 6, 6)), np.zeros((3, 6))
    T_trial = np.zeros((3, 4))
    return Desk(square[0], square[1], square[2], square[3], line[0], line[1], line[2], T_trial)


@compiled
def refine(view: View, T: Array, desk: Desk) -> float:
    """Move T (3, 4) to the nearest optimum (Levenberg-Marquardt); its chi2, infinite if none.

    desk.H is the information at the last linearisation, at most 0.3 sigma away.
    """
    chi2 = linearise(view, T, desk.H, desk.g, desk.scratch)
    damping = 0.0
    for _ in range(_MAX_STEPS):
        if not chi2 < math.inf:
            return math.inf
        if not normal.factor(desk.H, damping, desk.L):
            damping = max(10.0 * damping, 1e-6)
            if damping > _MOST_DAMPING:
                return math.inf
            continue
        normal.solve(desk.L, desk.g, desk.delta)
        gain = 0.0
        for i in range(6):
            gain += desk.delta[i] * desk.g[i]
        exp_update(T, desk.delta, desk.T_trial)
        if gain < _LAST_GAIN and damping < 1e-3:
            copy(desk.T_trial, T)
            return max(chi2 - gain, 0.0)
        trial = linearise(view, desk.T_trial, desk.trial_H, desk.trial_g, desk.scratch)
        if trial <= chi2:
            chi2 = trial
            copy(desk.T_trial, T)
            copy(desk.trial_H, desk.H)
            for i in range(6):
                desk.g[i] = desk.trial_g[i]
            damping = 0.1 * damping if damping > 1e-6 else 0.0
        else:
            damping = max(10.0 * damping, 1e-4)
            if damping > _MOST_DAMPING:
                return chi2
    return chi2


@compiled
def mahalanobis(H: Array, xi: Array) -> float:
    """xi^T H xi, of the lower triangle of H."""
    total = 0.0
    for i in range(6):
        total += H[i, i] * xi[i] * xi[i]
        for j in range(i):
            total += 2.0 * H[i, j] * xi[i] * xi[j]
    return total


@compiled
def weakest(cov: Array, lever_m: float, step: Array, work: Array) -> None:
    """One sigma (6,) along the widest axis of cov, turns counted as `lever_m` metres a radian.

    Power iteration: where two axes are equally wide any mixture of them will do. work (6,).
    """
    for i in range(6):
        step[i] = 1.0 + 0.1 * i
    width = 1.0
    for _ in range(_POWERS):
        square = 0.0
        for i in range(6):
            s = 0.0
            for j in range(3):
                s += cov[i, j] * step[j] + cov[i, j + 3] * step[j + 3] * lever_m
            work[i] = s if i < 3 else s * lever_m
            square += work[i] * work[i]
        width = math.sqrt(square)
        for i in range(6):
            step[i] = work[i] / width
    sigma = math.sqrt(width)
    for i in range(3):
        step[i] *= sigma
        step[i + 3] *= sigma / lever_m


@compiled
def batch(view: View, T: Array, chi2: Array) -> None:
    """`refine` for S views that differ in p, ray and information alone: in `view` all of them are
    stacked, (S N, ..). T (S, 3, 4) are starts and become optima, chi2 (S,) theirs.
    """
    desk, n = new_desk(), len(view.p) // len(T)
    for s in range(len(T)):
        rows = slice(s * n, (s + 1) * n)
        one = View(
            view.p[rows],
            view.ray[rows],
            view.information[rows],
            view.cov,
            view.T_right_left,
            view.prior_T,
            view.prior_information,
            view.gravity,
            view.height,
        )
        chi2[s] = refine(one, T[s], desk)
