"""What moves in the plane only, with the three numbers that are left of six: x, y and turn.

The same as the general kernels make of it, at a fraction of the work.
"""

import math

from tagmap.conventions import Array
from tagmap.estimation.kernels.layout import Linear
from tagmap.estimation.kernels.small import (
    M,
    S,
    V,
    difference_of,
    full,
    inverse,
    product,
    subtract,
    symmetric_times,
    times,
    transpose,
    transposed_times,
    upper,
)
from tagmap.geometry.kernels.compiled import compiled, inlined, internal

_SMALL = 1e-2
# Where the turn stands among three numbers, and among six.
_ALONE, _IN_SPACE = 2, 5
_NOTHING = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@inlined
def step_residual(T: Array, i: int, measured: Array, row: int) -> tuple[V, V]:
    """(x, y, turn) of log(measured^-1 T_i^-1 T_i+1), and what `add_step` needs of the turn."""
    qx, qy = T[i + 1, 0, 3] - T[i, 0, 3], T[i + 1, 1, 3] - T[i, 1, 3]
    c, s = T[i, 0, 0], T[i, 1, 0]
    x, y = c * qx + s * qy - measured[row, 0, 3], c * qy - s * qx - measured[row, 1, 3]
    cm, sm = measured[row, 0, 0], measured[row, 1, 0]
    x, y = cm * x + sm * y, cm * y - sm * x
    c, s = c * cm - s * sm, s * cm + c * sm
    cj, sj = T[i + 1, 0, 0], T[i + 1, 1, 0]
    w, one, k = _turn(c * cj + s * sj, c * sj - s * cj)
    return (one * x + 0.5 * w * y, one * y - 0.5 * w * x, w), (0.5 * w, one, k)


@compiled
def _turn(c: float, s: float) -> V:
    """The angle w of that cosine and sine, w / 2 cot(w / 2), and what is missing of it to 1, by w.

    With t = tan(w / 2) the second is arctan(t) / t.
    """
    t = s / (1.0 + c)
    u = t * t
    if u < _SMALL:
        rest = 1 / 9 - u * (1 / 11 - u * (1 / 13 - u / 15))
        rest = 1 / 3 - u * (1 / 5 - u * (1 / 7 - u * rest))
        one = 1.0 - u * rest
        return 2.0 * t * one, one, 0.5 * t * rest / one
    w = math.atan2(s, c)
    one = 0.5 * w * s / (1.0 - c)
    return w, one, (1.0 - one) / w


@inlined
def of_plane(Q: Array, n: int) -> S:
    """Rows and columns x, y and turn of the symmetric Q[n] (6, 6)."""
    return Q[n, 0, 0], Q[n, 0, 1], Q[n, 0, 5], Q[n, 1, 1], Q[n, 1, 5], Q[n, 5, 5]


@inlined
def add_step(i: int, r: V, turn: V, Q: S, linear: Linear) -> None:
    """A step from pose i with residual r and information Q; sets `following`."""
    T, D, g6, off = linear.T, linear.diagonal, linear.pose_gradient, linear.following
    J = _by_pose(r, turn, T[i + 1, 0, 0], T[i + 1, 1, 0])
    K = product(transpose(J), product(full(Q), J))
    g = transposed_times(J, symmetric_times(Q, r))
    qx, qy = T[i + 1, 0, 3] - T[i, 0, 3], T[i + 1, 1, 3] - T[i, 1, 3]
    # carried to pose i: v_j = v_i - q x omega_i
    cx, cy = K[2] - K[0] * qy + K[1] * qx, K[5] - K[3] * qy + K[4] * qx
    cw = K[8] - K[2] * qy + K[5] * qx
    for a in range(6):
        for b in range(6):
            off[i, a, b] = 0.0
    _add(off, i, (-K[0], -K[1], -cx, -K[3], -K[4], -cy, -K[6], -K[7], -cw))
    _add(D, i + 1, K)
    _add(D, i, (K[0], K[1], cx, K[3], K[4], cy, cx, cy, cw + qx * cy - qy * cx))
    g6[i + 1, 0] += g[0]
    g6[i + 1, 1] += g[1]
    g6[i + 1, 5] += g[2]
    g6[i, 0] -= g[0]
    g6[i, 1] -= g[1]
    g6[i, 5] -= g[2] + qx * g[1] - qy * g[0]


@inlined
def _by_pose(r: V, turn: V, c: float, s: float) -> M:
    """The residual by the later pose, of cosine c and sine s, in axes of the map."""
    (x, y, _), (h, one, k) = r, turn
    a, b = one * c + h * s, one * s - h * c
    return a, b, k * x + 0.5 * y, -b, a, k * y - 0.5 * x, 0.0, 0.0, 1.0


@inlined
def _add(A: Array, i: int, K: M) -> None:
    A[i, 0, 0] += K[0]
    A[i, 0, 1] += K[1]
    A[i, 0, 5] += K[2]
    A[i, 1, 0] += K[3]
    A[i, 1, 1] += K[4]
    A[i, 1, 5] += K[5]
    A[i, 5, 0] += K[6]
    A[i, 5, 1] += K[7]
    A[i, 5, 5] += K[8]


@internal
def factor(linear: Linear, damping: float, L: Array, D: Array) -> bool:
    """As tagmap.estimation.kernels.chain.factor, with L and D (N, 3, 3)."""
    P = _NOTHING
    for i in range(len(linear.diagonal)):
        a, b, c, d, e, f = of_plane(linear.diagonal, i)
        a += damping * max(a, 1.0)
        d += damping * max(d, 1.0)
        f += damping * max(f, 1.0)
        whole = a, b, c, d, e, f
        if i > 0:
            link = _block(linear.following, i - 1, _IN_SPACE)
            by = product(link, full(P))
            whole = upper(difference_of(full(whole), product(by, transpose(link))))
            _store(by, L, i)
        good, P = inverse(whole)
        if not good:
            return False
        _store(full(P), D, i)
    return True


@internal
def solve(L: Array, D: Array, x: Array) -> None:
    """x (N, 6) <- A^-1 x, where x has nothing out of the plane."""
    n = len(x)
    y = 0.0, 0.0, 0.0
    for i in range(n):
        y = x[i, 0], x[i, 1], x[i, 5]
        if i > 0:
            y = subtract(y, times(_block(L, i, _ALONE), (x[i - 1, 0], x[i - 1, 1], x[i - 1, 5])))
        x[i, 0], x[i, 1], x[i, 5] = y
    for i in range(n - 1, -1, -1):
        z = times(_block(D, i, _ALONE), (x[i, 0], x[i, 1], x[i, 5]))
        if i + 1 < n:
            z = subtract(z, transposed_times(_block(L, i + 1, _ALONE), y))
        y = z
        x[i, 0], x[i, 1], x[i, 5] = y


@inlined
def _block(A: Array, i: int, turn: int) -> M:
    """Rows and columns 0, 1 and `turn` of A (N, 3, 3) or (N, 6, 6)."""
    return (
        A[i, 0, 0],
        A[i, 0, 1],
        A[i, 0, turn],
        A[i, 1, 0],
        A[i, 1, 1],
        A[i, 1, turn],
        A[i, turn, 0],
        A[i, turn, 1],
        A[i, turn, turn],
    )


@inlined
def _store(K: M, A: Array, i: int) -> None:
    for a in range(3):
        for b in range(3):
            A[i, a, b] = K[3 * a + b]


@internal
def lift(A: Array, rest: float, out: Array) -> None:
    """Blocks (N, 3, 3) among those of six coordinates, out (N, 6, 6); `rest`: of the others."""
    out[:] = 0.0
    for i in range(len(A)):
        _add(out, i, _block(A, i, _ALONE))
        out[i, 2, 2] = out[i, 3, 3] = out[i, 4, 4] = rest
