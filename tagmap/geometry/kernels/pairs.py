"""Two cameras, compiled: where tagmap.geometry.stereo is computed. Cameras as in `lens`."""

import math

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled, internal
from tagmap.geometry.kernels.lens import see, unbend

_STEPS = 6
# Of the product of the diagonal: what is left of a determinant below it is rounding.
_RELATIVE_DETERMINANT = 1e-15


@compiled
def project(left: Array, right: Array, T: Array, p: Array, px: Array, J: Array) -> None:
    """Pixels (N, 4) of points (N, 3) in cam, with J (N, 4, 3); T (4, 4): right from left."""
    moved = np.empty(3)
    for i in range(len(p)):
        see_both(left, right, T, p[i], moved, px[i], J[i])


@internal
def see_both(
    left: Array, right: Array, T: Array, p: Array, moved: Array, px: Array, J: Array
) -> None:
    """Of one point; `moved` (3,) takes it in the right camera."""
    for i in range(3):
        moved[i] = T[i, 0] * p[0] + T[i, 1] * p[1] + T[i, 2] * p[2] + T[i, 3]
    see(left, p, px[:2], J[:2])
    see(right, moved, px[2:], J[2:])
    for i in range(2, 4):
        a, b, c = J[i, 0], J[i, 1], J[i, 2]
        for j in range(3):
            J[i, j] = a * T[0, j] + b * T[1, j] + c * T[2, j]


@compiled
def triangulate(
    left: Array, right: Array, T: Array, z: Array, weight: Array, p: Array, cov: Array, chi2: Array
) -> None:
    """Points p (N, 3) with cov (N, 3, 3) and chi2 (N,) of pixels z (N, 4) with weight (N, 4, 4):
    Gauss-Newton from where the rays come nearest. All NaN where they do not meet in front."""
    moved, px, J, JW = np.empty(3), np.empty(4), np.empty((4, 3)), np.empty((3, 4))
    for k in range(len(z)):
        _intersect(left, right, T, z[k], J, JW, p[k])
        for _ in range(_STEPS):
            see_both(left, right, T, p[k], moved, px, J)
            _weigh(J, weight[k], JW)
            _invert(J, JW, cov[k])
            _step(JW, cov[k], z[k], px, p[k])
        see_both(left, right, T, p[k], moved, px, J)
        chi2[k] = _chi2(z[k], px, weight[k])
        if not abs(chi2[k]) < math.inf:
            p[k], cov[k], chi2[k] = math.nan, math.nan, math.nan


@compiled
def _intersect(
    left: Array, right: Array, T: Array, z: Array, A: Array, At: Array, p: Array
) -> None:
    """Least squares of the four equations x z = X, y z = Y of the two ideal rays; A (4, 3)."""
    x, y = unbend(left, z[0], z[1])
    u, v = unbend(right, z[2], z[3])
    A[0, 0], A[0, 1], A[0, 2] = 1.0, 0.0, -x
    A[1, 0], A[1, 1], A[1, 2] = 0.0, 1.0, -y
    for j in range(3):
        A[2, j], A[3, j] = T[0, j] - u * T[2, j], T[1, j] - v * T[2, j]
    for i in range(4):
        for j in range(3):
            At[j, i] = A[i, j]
    b, c = u * T[2, 3] - T[0, 3], v * T[2, 3] - T[1, 3]
    h00, h01, h02, h11, h12, h22 = _inverse(A, At)
    g0, g1 = A[2, 0] * b + A[3, 0] * c, A[2, 1] * b + A[3, 1] * c
    g2 = A[2, 2] * b + A[3, 2] * c
    p[0] = h00 * g0 + h01 * g1 + h02 * g2
    p[1] = h01 * g0 + h11 * g1 + h12 * g2
    p[2] = h02 * g0 + h12 * g1 + h22 * g2


@compiled
def _weigh(J: Array, weight: Array, JW: Array) -> None:
    for i in range(3):
        for j in range(4):
            s = 0.0
            for k in range(4):
                s += J[k, i] * weight[k, j]
            JW[i, j] = s


@compiled
def _invert(J: Array, JW: Array, cov: Array) -> None:
    """cov (3, 3) = (JW J)^-1."""
    h00, h01, h02, h11, h12, h22 = _inverse(J, JW)
    cov[0, 0], cov[1, 1], cov[2, 2] = h00, h11, h22
    cov[0, 1] = cov[1, 0] = h01
    cov[0, 2] = cov[2, 0] = h02
    cov[1, 2] = cov[2, 1] = h12


@compiled
def _inverse(J: Array, JW: Array) -> tuple[float, float, float, float, float, float]:
    """Of JW J (3, 3), symmetric: 00, 01, 02, 11, 12, 22. NaN where singular: parallel rays."""
    a = b = c = d = e = f = 0.0
    for k in range(4):
        a += JW[0, k] * J[k, 0]
        b += JW[0, k] * J[k, 1]
        c += JW[0, k] * J[k, 2]
        d += JW[1, k] * J[k, 1]
        e += JW[1, k] * J[k, 2]
        f += JW[2, k] * J[k, 2]
    c00, c01, c02 = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * c00 + b * c01 + c * c02
    if not abs(determinant) > _RELATIVE_DETERMINANT * abs(a * d * f):
        return math.nan, math.nan, math.nan, math.nan, math.nan, math.nan
    r = 1.0 / determinant
    return c00 * r, c01 * r, c02 * r, (a * f - c * c) * r, (b * c - a * e) * r, (a * d - b * b) * r


@compiled
def _step(JW: Array, cov: Array, z: Array, px: Array, p: Array) -> None:
    g0 = g1 = g2 = 0.0
    for k in range(4):
        error = z[k] - px[k]
        g0 += JW[0, k] * error
        g1 += JW[1, k] * error
        g2 += JW[2, k] * error
    for i in range(3):
        p[i] += cov[i, 0] * g0 + cov[i, 1] * g1 + cov[i, 2] * g2


@compiled
def _chi2(z: Array, px: Array, weight: Array) -> float:
    s = 0.0
    for i in range(4):
        for j in range(4):
            s += (z[i] - px[i]) * weight[i, j] * (z[j] - px[j])
    return s
