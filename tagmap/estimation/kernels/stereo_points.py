"""The points that stereo sightings show, one at a time, as Gaussians in information form.

The same as tagmap.geometry.stereo.triangulate, from what the solver keeps of a sighting.
"""

import math

from tagmap.conventions import Array
from tagmap.estimation.kernels.forms import (
    STEREO_PX,
    columns,
    inner,
    predict,
    residual,
    whitened,
)
from tagmap.estimation.kernels.small import S, V, dot, inverse, subtract, symmetric_times
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.rays import undistort

_MOST_STEPS = 6
# Gauss-Newton all but squares a small step: what is left after one this small is rounding.
_LAST_STEP = 1e-7


@compiled
def triangulate(
    rig: Array, z: Array, whiten: Array, least: float, p: Array, information: Array
) -> None:
    """p (K, 3) in cam and information (K, 3, 3) of stereo pixels z (K, 4), whiten (K, 10).

    NaN where the rays do not meet in front of both cameras, or where the covariance's correlations
    have a determinant of no more than `least`. rig (30,): see tagmap.estimation.kernels.forms.
    """
    for k in range(len(z)):
        met, x = _between(rig, z[k])
        W = cov = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for _ in range(_MOST_STEPS):
            if met:
                met, W, cov, step = _step(rig, z, whiten, k, x)
                x = subtract(x, step)
                if dot(step, step) <= _LAST_STEP**2 * dot(x, x):
                    break
        met = met and x[2] > 0.0 and _determinant(cov) > least * cov[0] * cov[3] * cov[5]
        for n in range(3):
            p[k, n] = x[n] if met else math.nan
        information[k, 0, 0], information[k, 1, 1], information[k, 2, 2] = W[0], W[3], W[5]
        information[k, 0, 1] = information[k, 1, 0] = W[1]
        information[k, 0, 2] = information[k, 2, 0] = W[2]
        information[k, 1, 2] = information[k, 2, 1] = W[4]


@compiled
def _step(rig: Array, z: Array, whiten: Array, k: int, x: V) -> tuple[bool, S, S, V]:
    """Whether x is seen and determined, its information and covariance, the step to take off x."""
    seen, predicted, a, b, c, d = predict(STEREO_PX, rig, x)
    r = whitened(whiten, k, residual(STEREO_PX, predicted, z, k))
    u, v, w = columns(a, b, c, d, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    u, v, w = whitened(whiten, k, u), whitened(whiten, k, v), whitened(whiten, k, w)
    W = inner(u, u), inner(u, v), inner(u, w), inner(v, v), inner(v, w), inner(w, w)
    good, cov = inverse(W)
    return seen and good, W, cov, symmetric_times(cov, (inner(u, r), inner(v, r), inner(w, r)))


@compiled
def _determinant(A: S) -> float:
    return (
        A[0] * (A[3] * A[5] - A[4] * A[4])
        - A[1] * (A[1] * A[5] - A[2] * A[4])
        + A[2] * (A[1] * A[4] - A[2] * A[3])
    )


@compiled
def _between(rig: Array, z: Array) -> tuple[bool, V]:
    """Least squares of the four equations x z = X, y z = Y of the two ideal rays."""
    left = undistort(rig[:9], z[0], z[1])
    right = undistort(rig[9:18], z[2], z[3])
    x, y = left[0], left[1]
    a0, a1, a2, a3, a4, a5 = 1.0, 0.0, -x, 1.0, -y, x * x + y * y
    b0 = b1 = b2 = 0.0
    for i in range(2):
        s = right[i]
        e0, e1 = rig[18 + 3 * i] - s * rig[24], rig[19 + 3 * i] - s * rig[25]
        e2, f = rig[20 + 3 * i] - s * rig[26], s * rig[29] - rig[27 + i]
        a0, a1, a2 = a0 + e0 * e0, a1 + e0 * e1, a2 + e0 * e2
        a3, a4, a5 = a3 + e1 * e1, a4 + e1 * e2, a5 + e2 * e2
        b0, b1, b2 = b0 + e0 * f, b1 + e1 * f, b2 + e2 * f
    good, cov = inverse((a0, a1, a2, a3, a4, a5))
    return good, symmetric_times(cov, (b0, b1, b2))
