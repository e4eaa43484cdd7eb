"""The distinct optima of a search, best first."""

import math
from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.inlined import inlined
from tagmap.localisation.kernels.motion import Pose, Step, between
from tagmap.localisation.kernels.refine import refine
from tagmap.localisation.kernels.square import Square, form
from tagmap.localisation.kernels.view import View

MOST = 4
# Squared Mahalanobis distance.
_SAME_POSE = 1.0
# Poses whose chi2 differs by less explain a view equally well: the difference is rounding.
_CHI2_STEP = 1e-6
# Askew to whatever people build along, so that mirrored poses do not lie at equal heights.
_UPWARDS = (0.5698402910, 0.7548776662, 1.0)


class Found(NamedTuple):
    """T (4, 12), information (4, 21) at it, chi2 (4,)."""

    T: Array
    H: Array
    chi2: Array


@compiled
def new_found() -> Found:
    return Found(np.zeros((MOST, 12)), np.zeros((MOST, 21)), np.zeros(MOST))


@inlined
def pose(found: Found, k: int) -> Pose:
    T = found.T
    return (
        T[k, 0], T[k, 1], T[k, 2], T[k, 3],
        T[k, 4], T[k, 5], T[k, 6], T[k, 7],
        T[k, 8], T[k, 9], T[k, 10], T[k, 11],
    )  # fmt: skip


@inlined
def information(found: Found, k: int) -> Square:
    H = found.H
    return (
        H[k, 0], H[k, 1], H[k, 2], H[k, 3], H[k, 4], H[k, 5], H[k, 6],
        H[k, 7], H[k, 8], H[k, 9], H[k, 10], H[k, 11], H[k, 12], H[k, 13],
        H[k, 14], H[k, 15], H[k, 16], H[k, 17], H[k, 18], H[k, 19], H[k, 20],
    )  # fmt: skip


@compiled
def _is_behind(found: Found, k: int, chi2: float, T: Pose) -> bool:
    """Whether pose k comes after another of `chi2`: it fits worse or, where both fit as well, lies
    farther upwards in the map. Which of a view's exact roots is the first then depends neither on
    rounding nor on the order of tags."""
    steps = np.rint(found.chi2[k] / _CHI2_STEP) - np.rint(chi2 / _CHI2_STEP)
    x, y, z = _UPWARDS
    height = x * T[3] + y * T[7] + z * T[11]
    own = x * found.T[k, 3] + y * found.T[k, 7] + z * found.T[k, 11]
    behind: bool = steps > 0.0 or (steps == 0.0 and own > height)
    return behind


@compiled
def add(view: View, T: Pose, found: Found, n: int) -> int:
    """Refine T and sort it in, unless it leads to a pose that is there; their number."""
    chi2, T, H = refine(view, T)
    if not chi2 < math.inf:
        return n
    for k in range(n):
        xi: Step = between(pose(found, k), T)
        if form(H, xi) < _SAME_POSE or form(information(found, k), xi) < _SAME_POSE:
            return n
    if n == MOST and chi2 >= found.chi2[MOST - 1]:
        return n
    at = min(n, MOST - 1)
    while at > 0 and _is_behind(found, at - 1, chi2, T):
        found.chi2[at] = found.chi2[at - 1]
        for i in range(12):
            found.T[at, i] = found.T[at - 1, i]
        for i in range(21):
            found.H[at, i] = found.H[at - 1, i]
        at -= 1
    found.chi2[at] = chi2
    for i in range(12):
        found.T[at, i] = T[i]
    for i in range(21):
        found.H[at, i] = H[i]
    return min(n + 1, MOST)
