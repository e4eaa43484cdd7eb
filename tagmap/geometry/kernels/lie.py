"""Exponential and logarithm of rotations and rigid transforms, compiled: where tagmap.geometry.so3
and se3 are computed. Their conventions and sources hold here."""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.small_angle import COTANGENT, SINE_3, SMALL_RAD

_SINE_3, _COTANGENT = tuple(SINE_3), tuple(COTANGENT)
_SMALL_SINE = 1e-4

V = tuple[float, float, float]


@compiled
def rotations(omega: Array, R: Array) -> None:
    """R (N, 3, 3) of rotation vectors (N, 3): Rodrigues' formula."""
    for i in range(len(omega)):
        _rotation(omega[i, 0], omega[i, 1], omega[i, 2], R[i])


@compiled
def transforms(xi: Array, T: Array) -> None:
    """T (N, 4, 4) of tangents (N, 6)."""
    for i in range(len(xi)):
        u, v, w, x, y, z = xi[i, 0], xi[i, 1], xi[i, 2], xi[i, 3], xi[i, 4], xi[i, 5]
        angle = math.sqrt(x * x + y * y + z * z)
        c, r = cosine_quotient(angle), sine_remainder(angle)
        one = _cross((x, y, z), (u, v, w))
        two = _cross((x, y, z), one)
        _rotation(x, y, z, T[i])
        T[i, 0, 3] = u + c * one[0] + r * two[0]
        T[i, 1, 3] = v + c * one[1] + r * two[1]
        T[i, 2, 3] = w + c * one[2] + r * two[2]
        T[i, 3, 0] = T[i, 3, 1] = T[i, 3, 2] = 0.0
        T[i, 3, 3] = 1.0


@compiled
def vectors(R: Array, omega: Array) -> None:
    """Rotation vectors (N, 3) of R (N, 3, 3), of at most pi."""
    for i in range(len(R)):
        omega[i, 0], omega[i, 1], omega[i, 2] = _vector(R[i])


@compiled
def tangents(T: Array, xi: Array) -> None:
    """(N, 6) of T (N, 4, 4), whose rotation is at most pi."""
    for i in range(len(T)):
        omega = _vector(T[i])
        x, y, z = omega
        k = cotangent_remainder(math.sqrt(x * x + y * y + z * z))
        p = T[i, 0, 3], T[i, 1, 3], T[i, 2, 3]
        one = _cross(omega, p)
        two = _cross(omega, one)
        for j in range(3):
            xi[i, j] = p[j] - 0.5 * one[j] + k * two[j]
            xi[i, 3 + j] = omega[j]


@compiled
def _rotation(x: float, y: float, z: float, R: Array) -> None:
    """Into the upper left of R."""
    angle = math.sqrt(x * x + y * y + z * z)
    s, c = sine_quotient(angle), cosine_quotient(angle)
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y
    R[1, 0], R[1, 1], R[1, 2] = c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x
    R[2, 0], R[2, 1], R[2, 2] = c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)


@compiled
def _vector(R: Array) -> V:
    """By the quaternion, from the best conditioned row of its products."""
    a, b, c = R[0, 0], R[1, 1], R[2, 2]
    of_x, of_y, of_z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    xy, yz, zx = R[1, 0] + R[0, 1], R[2, 1] + R[1, 2], R[0, 2] + R[2, 0]
    ww, xx, yy, zz = 1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c
    if ww >= max(xx, yy, zz):
        w, x, y, z = ww, of_x, of_y, of_z
    elif xx >= max(yy, zz):
        w, x, y, z = of_x, xx, xy, zx
    elif yy >= zz:
        w, x, y, z = of_y, xy, yy, yz
    else:
        w, x, y, z = of_z, zx, yz, zz
    scale = math.copysign(1.0 / math.sqrt(w * w + x * x + y * y + z * z), w)
    w, x, y, z = w * scale, x * scale, y * scale, z * scale
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < _SMALL_SINE:
        scale = 2.0 / w * (1.0 - sine * sine / (3.0 * w * w))
    else:
        scale = 2.0 * math.atan2(sine, w) / sine
    return scale * x, scale * y, scale * z


@compiled
def _cross(a: V, b: V) -> V:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def sine_quotient(t: float) -> float:
    return math.sin(t) / t if t > 0.0 else 1.0 + t


@compiled
def cosine_quotient(t: float) -> float:
    half = math.sin(0.5 * t) / t if t > 0.0 else 0.5 + t
    return 2.0 * half * half


@compiled
def sine_remainder(t: float) -> float:
    if t < SMALL_RAD:
        return _horner(_SINE_3, t * t)
    return (t - math.sin(t)) / (t * t * t)


@compiled
def cotangent_remainder(t: float) -> float:
    if t < SMALL_RAD:
        return _horner(_COTANGENT, t * t)
    return (1.0 - 0.5 * t / math.tan(0.5 * t)) / (t * t)


@compiled
def _horner(coefficients: tuple[float, ...], square: float) -> float:
    value = 0.0
    for coefficient in coefficients:
        value = value * square + coefficient
    return value
