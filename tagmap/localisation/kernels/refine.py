"""From a start to the nearest optimum."""

import math

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels import beside, sightings
from tagmap.localisation.kernels.motion import Pose, load, moved, store
from tagmap.localisation.kernels.square import Square, dot, factor, solve
from tagmap.localisation.kernels.view import View, linearise

# A few starts creep along a curved valley; stopped there they would pass for optima.
_MAX_STEPS = 100
# A step that gains less chi2 than this moves the pose by 0.1 sigma; what it leaves is of second
# order in that.
_LAST_GAIN = 0.01
_MOST_DAMPING = 1e8


@compiled
def refine(view: View, T: Pose) -> tuple[float, Pose, Square]:
    """chi2, T_map_cam and information of the optimum nearest to T (Levenberg-Marquardt).

    chi2 is infinite if there is none; the information is that of the last linearisation, at most
    0.1 sigma away.
    """
    chi2, H, g = linearise(view, T)
    damping = 0.0
    for _ in range(_MAX_STEPS):
        if not chi2 < math.inf:
            return math.inf, T, H
        good, L = factor(H, damping)
        if not good:
            damping = max(10.0 * damping, 1e-6)
            if damping > _MOST_DAMPING:
                return math.inf, T, H
            continue
        step = solve(L, g)
        gain = dot(step, g)
        T_trial = moved(T, step)
        if gain < _LAST_GAIN and damping < 1e-3:
            return max(chi2 - gain, 0.0), T_trial, H
        trial, trial_H, trial_g = linearise(view, T_trial)
        if trial <= chi2:
            chi2, T, H, g = trial, T_trial, trial_H, trial_g
            damping = 0.1 * damping if damping > 1e-6 else 0.0
        else:
            damping = max(10.0 * damping, 1e-4)
            if damping > _MOST_DAMPING:
                break
    return chi2, T, H


@compiled
def batch(
    p: Array, ray: Array, information: Array, T_right_left: Array, T: Array, chi2: Array
) -> None:
    """`refine` for S views: p (S, N, 3), ray (S, N, 4), information (S, N, 4, 4) of rays, or
    (1, N, 4, 4). T (S, 1, 4, 4) are starts and become optima, chi2 (S,) theirs."""
    rows = np.zeros((p.shape[1], sightings.WIDTH))
    exact, known, rig = np.zeros((1, 0, 3, 3)), np.zeros(beside.WIDTH), load(T_right_left)
    for s in range(len(T)):
        n = sightings.from_rays(p, ray, information, exact, s, rows)
        chi2[s], found, _ = refine(View(rows, n, False, known, False, rig), load(T[s, 0]))
        store(found, T, s, 0)
