"""What a pose is worth: its covariance, and whether that is a promise."""

import math

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.inlined import inlined
from tagmap.localisation.kernels.motion import Pose, Step, moved
from tagmap.localisation.kernels.sightings import P
from tagmap.localisation.kernels.square import Square, dot, factor, inverse, spread, squared, times
from tagmap.localisation.kernels.view import View, cost
from tagmap.localisation.pose import Doubt

# As plain numbers, for compiled code.
FEW, COLLINEAR, NO_ROOT, AMBIGUOUS, CURVED, SINGULAR, MISFIT, NO_RAY = (int(one) for one in Doubt)

_COLLINEAR_SHARE = 1e-3
_LINEAR_SIGMAS = 3.0
_LINEAR_SHARE = 0.35
_STRAIGHT = 0.002
_MOST_SIGMA = 0.25


@compiled
def is_collinear(rows: Array, n: int) -> bool:
    """Whether the tags lie on one line to a thousandth of its length."""
    far, base = 0.0, 0
    for i in range(1, n):
        x, y, z = _from_first(rows, i)
        square = x * x + y * y + z * z
        if square > far:
            far, base = square, i
    x, y, z = _from_first(rows, base)
    for i in range(1, n):
        u, v, w = _from_first(rows, i)
        a, b, c = y * w - z * v, z * u - x * w, x * v - y * u
        if a * a + b * b + c * c > (_COLLINEAR_SHARE * far) ** 2:
            return False
    return True


@compiled
def _from_first(rows: Array, i: int) -> tuple[float, float, float]:
    return rows[i, P] - rows[0, P], rows[i, P + 1] - rows[0, P + 1], rows[i, P + 2] - rows[0, P + 2]


@inlined
def judge(view: View, T: Pose, H: Square, chi2: float, cov: Array) -> int:
    """Covariance (6, 6) of the pose T, and the flags that say that it is not one to rely on."""
    good, L = factor(H, 0.0)
    if not good:
        cov[:] = np.nan
        return SINGULAR
    C = inverse(L)
    spread(C, cov)
    least, most = math.inf, 0.0
    for i in range(view.n):
        x, y = view.rows[i, P] - T[3], view.rows[i, P + 1] - T[7]
        z = view.rows[i, P + 2] - T[11]
        square = x * x + y * y + z * z
        least, most = min(least, square), max(most, square)
    variance = max(C[0] + C[2] + C[5], (C[9] + C[14] + C[20]) * least)
    if not variance < _MOST_SIGMA * _MOST_SIGMA * least:
        return CURVED
    if variance < _STRAIGHT * _STRAIGHT * least:
        return 0
    return 0 if _is_linear(view, T, chi2, weakest(C, math.sqrt(most))) else CURVED


@inlined
def _is_linear(view: View, T: Pose, chi2: float, sigma: Step) -> bool:
    """Three sigmas either way along the weakest direction chi2 must rise by about nine."""
    for side in range(2):
        s = _LINEAR_SIGMAS - 2.0 * _LINEAR_SIGMAS * side
        step = (s * sigma[0], s * sigma[1], s * sigma[2], s * sigma[3], s * sigma[4], s * sigma[5])
        share = (cost(view, moved(T, step)) - chi2) / (_LINEAR_SIGMAS * _LINEAR_SIGMAS)
        if not abs(share - 1.0) < _LINEAR_SHARE:
            return False
    return True


@compiled
def weakest(C: Square, lever_m: float) -> Step:
    """One sigma along the widest axis of C, turns counted as `lever_m` metres a radian.

    By powers of C: where two axes are equally wide any mixture of them will do.
    """
    # In units of the trace the largest root is 1 / 6 or more: eight powers need no scaling.
    trace = C[0] + C[2] + C[5] + (C[9] + C[14] + C[20]) * lever_m * lever_m
    a = 1.0 / trace
    b, c = a * lever_m, a * lever_m * lever_m
    S = (
        a * C[0],
        a * C[1], a * C[2],
        a * C[3], a * C[4], a * C[5],
        b * C[6], b * C[7], b * C[8], c * C[9],
        b * C[10], b * C[11], b * C[12], c * C[13], c * C[14],
        b * C[15], b * C[16], b * C[17], c * C[18], c * C[19], c * C[20],
    )  # fmt: skip
    x = times(squared(squared(squared(S))), (1.0, 1.1, 1.2, 1.3, 1.4, 1.5))
    y = times(S, x)
    square = dot(y, y)
    width = trace * math.sqrt(square / dot(x, x))
    s = math.sqrt(width / square)
    t = s / lever_m
    return s * y[0], s * y[1], s * y[2], t * y[3], t * y[4], t * y[5]
