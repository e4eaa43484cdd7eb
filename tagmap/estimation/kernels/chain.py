"""The block tridiagonal system of the poses: A = (I + L) D^-1 (I + L)', and what is left of it.

One pass along the chains factors it, one forth and one back solve it.
"""

from tagmap.conventions import Array
from tagmap.estimation.kernels import plane
from tagmap.estimation.kernels.layout import Linear
from tagmap.estimation.kernels.small import (
    V,
    add,
    cross,
    difference_of,
    full,
    inverse,
    product,
    subtract,
    sum_of,
    symmetric_times,
    transpose,
    upper,
)
from tagmap.geometry.kernels.compiled import compiled, internal


@compiled
def invert(A: Array, out: Array) -> bool:
    """out = A^-1 of a symmetric (6, 6); False where it is not positive definite."""
    good, P = inverse((A[0, 0], A[0, 1], A[0, 2], A[1, 1], A[1, 2], A[2, 2]))
    if not good:
        return False
    B = (
        A[0, 3],
        A[0, 4],
        A[0, 5],
        A[1, 3],
        A[1, 4],
        A[1, 5],
        A[2, 3],
        A[2, 4],
        A[2, 5],
    )
    E = product(full(P), B)
    C = (A[3, 3], A[3, 4], A[3, 5], A[3, 4], A[4, 4], A[4, 5], A[3, 5], A[4, 5], A[5, 5])
    good, Q = inverse(upper(difference_of(C, product(transpose(B), E))))
    if not good:
        return False
    F = product(E, full(Q))
    G = sum_of(full(P), product(F, transpose(E)))
    n = 0
    for a in range(3):
        for b in range(3):
            out[a, b] = G[3 * a + b]
            out[a, 3 + b] = out[3 + b, a] = -F[3 * a + b]
        for b in range(a, 3):
            out[3 + a, 3 + b] = out[3 + b, 3 + a] = Q[n]
            n += 1
    return True


@compiled
def factor(linear: Linear, damping: float, L: Array, D: Array, S: Array) -> bool:
    """L (N, 6, 6), with L[0] unused, and D (N, 6, 6), the inverse blocks; S (6, 6) is for work.

    False where A is not positive definite. damping: part by which diagonal entries are raised.
    Where nothing leaves the plane L and D may be (N, 3, 3), of x, y and turn.
    """
    if L.shape[1] == 3:
        return plane.factor(linear, damping, L, D)
    diagonal, following = linear.diagonal, linear.following
    for i in range(len(diagonal)):
        for a in range(6):
            for b in range(6):
                S[a, b] = diagonal[i, a, b]
            S[a, a] += damping * max(S[a, a], 1.0)
        if i > 0:
            for a in range(6):
                for b in range(6):
                    sum_ = 0.0
                    for e in range(6):
                        sum_ += following[i - 1, a, e] * D[i - 1, e, b]
                    L[i, a, b] = sum_
            for a in range(6):
                for b in range(6):
                    sum_ = 0.0
                    for e in range(6):
                        sum_ += L[i, a, e] * following[i - 1, b, e]
                    S[a, b] -= sum_
        if not invert(S, D[i]):
            return False
    return True


@compiled
def solve(L: Array, D: Array, x: Array) -> None:
    """x (N, 6) <- A^-1 x."""
    if L.shape[1] == 3:
        plane.solve(L, D, x)
        return
    for i in range(1, len(x)):
        for a in range(6):
            sum_ = 0.0
            for b in range(6):
                sum_ += L[i, a, b] * x[i - 1, b]
            x[i, a] -= sum_
    _back(L, D, x)


@compiled
def _back(L: Array, D: Array, x: Array) -> None:
    n = len(x)
    y0 = y1 = y2 = y3 = y4 = y5 = 0.0
    for i in range(n - 1, -1, -1):
        z0, z1, z2, z3, z4, z5 = x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4], x[i, 5]
        for a in range(6):
            x[i, a] = (
                D[i, a, 0] * z0
                + D[i, a, 1] * z1
                + D[i, a, 2] * z2
                + D[i, a, 3] * z3
                + D[i, a, 4] * z4
                + D[i, a, 5] * z5
            )
        if i + 1 < n:
            for a in range(6):
                x[i, a] -= (
                    L[i + 1, 0, a] * y0
                    + L[i + 1, 1, a] * y1
                    + L[i + 1, 2, a] * y2
                    + L[i + 1, 3, a] * y3
                    + L[i + 1, 4, a] * y4
                    + L[i + 1, 5, a] * y5
                )
        y0, y1, y2, y3, y4, y5 = x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4], x[i, 5]


@internal
def lever(p: Array, t: int, T: Array, i: int) -> V:
    """q of a sighting of tag t from pose i."""
    return p[t, 0] - T[i, 0, 3], p[t, 1] - T[i, 1, 3], p[t, 2] - T[i, 2, 3]


@compiled
def poses_of(linear: Linear, L: Array, D: Array, x: Array, c: Array, u: Array) -> None:
    """u (N, 6) = A^-1 B (x, c): what the poses do when tags move by x (M, 3), calibration by c."""
    p, T, seen, slots = linear.p, linear.T, linear.seen, linear.pose_calibration.shape[2]
    for i in range(len(u)):
        v, w = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for k in range(linear.first[i], linear.first[i + 1]):
            t = linear.tag[k]
            W = seen[k, 0], seen[k, 1], seen[k, 2], seen[k, 3], seen[k, 4], seen[k, 5]
            y = symmetric_times(W, (x[t, 0], x[t, 1], x[t, 2]))
            v = subtract(v, y)
            w = subtract(w, cross(lever(p, t, T, i), y))
        for a in range(3):
            u[i, a], u[i, 3 + a] = v[a], w[a]
        for s in range(slots):
            if linear.slot_column[i, s] >= 0:
                for a in range(6):
                    u[i, a] += linear.pose_calibration[i, a, s] * c[linear.slot_column[i, s]]
    solve(L, D, u)


@compiled
def scatter(linear: Linear, x: Array, by_tag: float, u: Array, out: Array, out_c: Array) -> None:
    """out (M, 3) += by_tag C x - B' u of the sightings, out_c (Q,) -= E' u of calibration."""
    p, T, seen, slots = linear.p, linear.T, linear.seen, linear.pose_calibration.shape[2]
    for i in range(len(u)):
        v, w = (u[i, 0], u[i, 1], u[i, 2]), (u[i, 3], u[i, 4], u[i, 5])
        for k in range(linear.first[i], linear.first[i + 1]):
            t = linear.tag[k]
            W = seen[k, 0], seen[k, 1], seen[k, 2], seen[k, 3], seen[k, 4], seen[k, 5]
            e = add(v, cross(w, lever(p, t, T, i)))
            e = e[0] + by_tag * x[t, 0], e[1] + by_tag * x[t, 1], e[2] + by_tag * x[t, 2]
            y = symmetric_times(W, e)
            out[t, 0] += y[0]
            out[t, 1] += y[1]
            out[t, 2] += y[2]
        for s in range(slots):
            column = linear.slot_column[i, s]
            if column >= 0:
                for a in range(6):
                    out_c[column] -= linear.pose_calibration[i, a, s] * u[i, a]
