"""The level that the looks of a window promise: see tagmap.localisation.integrity.live."""

import math

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.dense import cholesky, largest_eigenvalue
from tagmap.localisation.kernels.rows import lever


@compiled
def level(
    r: Array,
    H: Array,
    valid: Mask,
    width: Index,
    cov: Array,
    bounds: Array,
    balls: Array,
    most_turn_rad: float,
    least: float,
) -> float:
    """Of poses that leave out one sighting each; NaN where there is none.

    r (N, k), H (N, k, dof) and cov (dof, dof) of the believed pose; bounds: the chi2 acceptable by
    degrees of freedom, infinite for none; balls (2,): see `ball_and_box`.
    """
    N, dof = len(H), H.shape[2]
    d, numbers, square = 3 if dof == 6 else 2, 0, 0.0
    A, b = np.zeros((dof, dof)), np.zeros(dof)
    for n in range(N):
        if valid[n]:
            numbers += width[n]
            square += _add(r[n], H[n], 1.0, A, b)
    rest, rest_b = np.empty((dof, dof)), np.empty(dof)
    inverse, delta = np.empty((dof, dof)), np.empty(dof)
    farthest, found = radius(cov, d, balls), False
    for n in range(N):
        if not valid[n]:
            continue
        for p in range(dof):
            rest_b[p] = b[p]
            for q in range(dof):
                rest[p, q] = A[p, q]
        chi2 = square + _add(r[n], H[n], -1.0, rest, rest_b)
        if not invert(rest, least, inverse):
            return math.nan
        for p in range(dof):
            delta[p] = 0.0
            for q in range(dof):
                delta[p] += inverse[p, q] * rest_b[q]
            chi2 -= delta[p] * rest_b[p]
        degrees = numbers - width[n] - dof
        if degrees > 0 and not chi2 <= bounds[degrees]:
            continue
        found = True
        reach = turn = spread = 0.0
        for p in range(d):
            reach += delta[p] * delta[p]
        for p in range(d, dof):
            turn += delta[p] * delta[p]
            spread += inverse[p, p]
        if not math.sqrt(turn) + 4.0 * math.sqrt(spread) <= most_turn_rad:
            return math.nan
        farthest = max(farthest, math.sqrt(reach) + radius(inverse, d, balls))
    return farthest if found else math.nan


@compiled
def _add(r: Array, H: Array, sign: float, A: Array, b: Array) -> float:
    """H^T H and H^T r of one sighting to A (dof, dof) and b (dof,); returns r^T r."""
    k, dof = H.shape
    square = 0.0
    for i in range(k):
        square += sign * r[i] * r[i]
        for p in range(dof):
            b[p] += sign * H[i, p] * r[i]
            for q in range(dof):
                A[p, q] += sign * H[i, p] * H[i, q]
    return square


@compiled
def radius(cov: Array, d: int, balls: Array) -> float:
    """See promise.radius, of the leading d x d part; balls: the chi2 of the ball, and the square of
    the box's half side."""
    total = 0.0
    for i in range(d):
        total += cov[i, i]
    return math.sqrt(min(balls[0] * largest_eigenvalue(cov, d), balls[1] * total))


@compiled
def invert(information: Array, least: float, out: Array) -> bool:
    """out = information^-1 (n, n); False where it leaves a direction open: the smallest eigenvalue,
    scaled to a unit diagonal, is not more than `least`, as the norm of the inverse tells."""
    n = len(information)
    scale, L, X = np.empty(n), np.empty((n, n)), np.zeros((n, n))
    for i in range(n):
        if not information[i, i] > 0.0:
            return False
        scale[i] = math.sqrt(information[i, i])
    for i in range(n):
        for j in range(n):
            L[i, j] = information[i, j] / (scale[i] * scale[j])
    if not cholesky(L):
        return False
    for j in range(n):
        X[j, j] = 1.0 / L[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for m in range(j, i):
                total -= L[i, m] * X[m, j]
            X[i, j] = total / L[i, i]
    norm = 0.0
    for i in range(n):
        for j in range(n):
            total = 0.0
            for m in range(max(i, j), n):
                total += X[m, i] * X[m, j]
            norm += total * total
            out[i, j] = total / (scale[i] * scale[j])
    return norm * least * least < 1.0


@compiled
def dilution(p_base: Array, shown: Array, least: float) -> float:
    """Position dilution of points p_base (N, d) of which the part shown (N, d, d), a projection in
    base axes, is measured; NaN where a direction is left open. Points shown by NaN do not count.
    """
    N, d = p_base.shape
    dof = 6 if d == 3 else 3
    A, B, back, inverse = (
        np.zeros((dof, dof)), np.empty((d, dof)), np.zeros((d, d)), np.empty((dof, dof))
    )  # fmt: skip
    for i in range(d):
        back[i, i] = -1.0
    for n in range(N):
        if not abs(shown[n, 0, 0]) < math.inf:
            continue
        lever(back, p_base[n], B)
        for p in range(dof):
            for q in range(dof):
                for i in range(d):
                    for j in range(d):
                        A[p, q] += B[i, p] * shown[n, i, j] * B[j, q]
    if not invert(A, least, inverse):
        return math.nan
    total = 0.0
    for i in range(d):
        total += inverse[i, i]
    return math.sqrt(total)
