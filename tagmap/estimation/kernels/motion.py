"""Rigid motions on numbers in registers: logarithm, its Jacobian, update."""

import math

from tagmap.conventions import Array
from tagmap.estimation.kernels.small import M, V, add, cross, product
from tagmap.geometry.kernels.compiled import compiled, internal

_SMALL = 1e-3


@internal
def rotation_of(T: Array) -> M:
    return (
        T[0, 0],
        T[0, 1],
        T[0, 2],
        T[1, 0],
        T[1, 1],
        T[1, 2],
        T[2, 0],
        T[2, 1],
        T[2, 2],
    )


@internal
def position_of(T: Array) -> V:
    return T[0, 3], T[1, 3], T[2, 3]


@internal
def logarithm(R: M, t: V) -> tuple[V, V]:
    """(v, omega) of [R, t]; turns are at most pi."""
    w = rotation_vector(R)
    c = _cotangent(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    a = cross(w, t)
    b = cross(w, a)
    v = (
        t[0] - 0.5 * a[0] + c * b[0],
        t[1] - 0.5 * a[1] + c * b[1],
        t[2] - 0.5 * a[2] + c * b[2],
    )
    return v, w


@internal
def rotation_vector(R: M) -> V:
    """By the best conditioned row of its quaternion (Bar-Itzhack 2000)."""
    a, b, c = R[0], R[4], R[8]
    s, u, v, r = 1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c
    if s >= u and s >= v and s >= r:
        w, x, y, z = s, R[7] - R[5], R[2] - R[6], R[3] - R[1]
    elif u >= v and u >= r:
        w, x, y, z = R[7] - R[5], u, R[3] + R[1], R[2] + R[6]
    elif v >= r:
        w, x, y, z = R[2] - R[6], R[3] + R[1], v, R[7] + R[5]
    else:
        w, x, y, z = R[3] - R[1], R[2] + R[6], R[7] + R[5], r
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    ratio = sine / w if w > 0.0 else math.inf
    if ratio < _SMALL:
        square = ratio * ratio
        factor = 2.0 / w * (1.0 - square / 3.0 + square * square / 5.0)
    else:
        factor = 2.0 * math.atan2(sine, w) / sine
    return factor * x, factor * y, factor * z


@compiled
def _cotangent(square: float) -> float:
    """(1 - h cot h) / (2 h)^2 with (2 h)^2 = `square`."""
    if square < _SMALL:
        return 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
    half = 0.5 * math.sqrt(square)
    return (1.0 - half * math.cos(half) / math.sin(half)) / square


@compiled
def _cotangent_slope(square: float) -> float:
    """Twice the derivative of `_cotangent` by its argument."""
    if square < 10.0 * _SMALL:
        return 1.0 / 360.0 + square * (
            1.0 / 7560.0 + square * (1.0 / 201600.0 + square / 5987520.0)
        )
    half = 0.5 * math.sqrt(square)
    sine = math.sin(half)
    return (half * math.cos(half) / sine + half * half / (sine * sine) - 2.0) / (square * square)


@internal
def inverse_right_jacobian(v: V, w: V) -> tuple[M, M]:
    """Its blocks A, B of [[A, B], [0, A]], at the tangent (v, w).

    By dual numbers: SE(3) is SO(3) over w + epsilon v, so B is the epsilon part of
    A = I + hat / 2 + c hat^2.
    """
    x, y, z = w
    square, along = x * x + y * y + z * z, x * v[0] + y * v[1] + z * v[2]
    c, s = _cotangent(square), _cotangent_slope(square) * along
    one = 1.0 - c * square
    A = (
        one + c * x * x,
        c * x * y - 0.5 * z,
        c * x * z + 0.5 * y,
        c * x * y + 0.5 * z,
        one + c * y * y,
        c * y * z - 0.5 * x,
        c * x * z - 0.5 * y,
        c * y * z + 0.5 * x,
        one + c * z * z,
    )
    off = -2.0 * c * along - s * square
    xy, xz = c * (v[0] * y + x * v[1]) + s * x * y, c * (v[0] * z + x * v[2]) + s * x * z
    yz = c * (v[1] * z + y * v[2]) + s * y * z
    B = (
        off + 2.0 * c * v[0] * x + s * x * x,
        xy - 0.5 * v[2],
        xz + 0.5 * v[1],
        xy + 0.5 * v[2],
        off + 2.0 * c * v[1] * y + s * y * y,
        yz - 0.5 * v[0],
        xz - 0.5 * v[1],
        yz + 0.5 * v[0],
        off + 2.0 * c * v[2] * z + s * z * z,
    )
    return A, B


@internal
def exponential(v: V, w: V) -> tuple[M, V]:
    """[R, t] of the tangent (v, omega)."""
    x, y, z = w
    square = x * x + y * y + z * z
    c, r = _cosine_quotient(square), _sine_remainder(square)
    s, one = 1.0 - square * r, 1.0 - c * square
    R = (
        one + c * x * x,
        c * x * y - s * z,
        c * x * z + s * y,
        c * x * y + s * z,
        one + c * y * y,
        c * y * z - s * x,
        c * x * z - s * y,
        c * y * z + s * x,
        one + c * z * z,
    )
    a = cross(w, v)
    b = cross(w, a)
    return R, (
        v[0] + c * a[0] + r * b[0],
        v[1] + c * a[1] + r * b[1],
        v[2] + c * a[2] + r * b[2],
    )


@internal
def right_jacobian(v: V, w: V) -> tuple[M, M]:
    """Its blocks A, B of [[A, B], [0, A]], at the tangent (v, w): the inverse of the one above.

    [[A, B], [0, A]]^-1 has the blocks A^-1 and -A^-1 B A^-1.
    """
    _, B = inverse_right_jacobian(v, w)
    x, y, z = w
    square = x * x + y * y + z * z
    c, r = _cosine_quotient(square), _sine_remainder(square)
    one = 1.0 - r * square
    J = (
        one + r * x * x,
        r * x * y + c * z,
        r * x * z - c * y,
        r * x * y - c * z,
        one + r * y * y,
        r * y * z + c * x,
        r * x * z + c * y,
        r * y * z - c * x,
        one + r * z * z,
    )
    K = product(J, product(B, J))
    return J, (-K[0], -K[1], -K[2], -K[3], -K[4], -K[5], -K[6], -K[7], -K[8])


@compiled
def move_all(T: Array, step: Array, out: Array) -> None:
    """out (N, 4, 4) = T moved by step (N, 6) = (v, omega) along the axes of the map.

    The same as T @ exp of the step in axes of each pose.
    """
    for i in range(len(T)):
        v = step[i, 0], step[i, 1], step[i, 2]
        w = step[i, 3], step[i, 4], step[i, 5]
        square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        c, r = _cosine_quotient(square), _sine_remainder(square)
        s = 1.0 - square * r
        for j in range(3):
            column = T[i, 0, j], T[i, 1, j], T[i, 2, j]
            once = cross(w, column)
            twice = cross(w, once)
            for k in range(3):
                out[i, k, j] = column[k] + s * once[k] + c * twice[k]
        once = cross(w, v)
        twice = cross(w, once)
        p = add(position_of(T[i]), v)
        for k in range(3):
            out[i, k, 3] = p[k] + c * once[k] + r * twice[k]
            out[i, 3, k] = 0.0
        out[i, 3, 3] = 1.0


@compiled
def _sine_remainder(square: float) -> float:
    """(x - sin x) / x^3 with x^2 = `square`."""
    if square < _SMALL:
        return 1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0)
    x = math.sqrt(square)
    return (x - math.sin(x)) / (square * x)


@compiled
def _cosine_quotient(square: float) -> float:
    """(1 - cos x) / x^2 with x^2 = `square`."""
    if square < _SMALL:
        return 0.5 - square * (1.0 / 24.0 - square / 720.0)
    half = math.sin(0.5 * math.sqrt(square))
    return 2.0 * half * half / square
