"""Poses as tuples of scalars, which stay in registers: R and p of T_map_cam, row by row.

A `Pose` is the twelve numbers of a (3, 4) matrix; a `Step` is a tangent (v, omega).
"""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.inlined import inlined

Pose = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
Step = tuple[float, float, float, float, float, float]

_SMALL_ANGLE = 1e-4
# Squared angle up to which five terms are exact to rounding.
_SERIES = 0.01


@compiled
def load(T: Array) -> Pose:
    """Of an array (3, 4) or (4, 4)."""
    return (
        T[0, 0], T[0, 1], T[0, 2], T[0, 3],
        T[1, 0], T[1, 1], T[1, 2], T[1, 3],
        T[2, 0], T[2, 1], T[2, 2], T[2, 3],
    )  # fmt: skip


@inlined
def store(T: Pose, out: Array, s: int, k: int) -> None:
    """As the homogeneous matrix out[s, k] of out (S, K, 4, 4)."""
    for i in range(3):
        for j in range(4):
            out[s, k, i, j] = T[4 * i + j]
    out[s, k, 3, 0] = out[s, k, 3, 1] = out[s, k, 3, 2] = 0.0
    out[s, k, 3, 3] = 1.0


@compiled
def moved(T: Pose, step: Step) -> Pose:
    """T @ exp(step). Orthonormal to second order whatever T is."""
    u, v, w, x, y, z = step
    q = x * x + y * y + z * z
    if q < _SERIES:
        s = 1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0)))
        c = 0.5 - q / 24.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0)))
        r = (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0)))) / 6.0
    else:
        angle = math.sqrt(q)
        s = math.sin(angle) / angle
        c = (1.0 - math.cos(angle)) / q
        r = (1.0 - s) / q
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    tx = u + c * cx + r * (y * cz - z * cy)
    ty = v + c * cy + r * (z * cx - x * cz)
    tz = w + c * cz + r * (x * cy - y * cx)
    e00, e11, e22 = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    e01, e10 = c * x * y - s * z, c * x * y + s * z
    e02, e20 = c * x * z + s * y, c * x * z - s * y
    e12, e21 = c * y * z - s * x, c * y * z + s * x
    return (
        T[0] * e00 + T[1] * e10 + T[2] * e20,
        T[0] * e01 + T[1] * e11 + T[2] * e21,
        T[0] * e02 + T[1] * e12 + T[2] * e22,
        T[3] + T[0] * tx + T[1] * ty + T[2] * tz,
        T[4] * e00 + T[5] * e10 + T[6] * e20,
        T[4] * e01 + T[5] * e11 + T[6] * e21,
        T[4] * e02 + T[5] * e12 + T[6] * e22,
        T[7] + T[4] * tx + T[5] * ty + T[6] * tz,
        T[8] * e00 + T[9] * e10 + T[10] * e20,
        T[8] * e01 + T[9] * e11 + T[10] * e21,
        T[8] * e02 + T[9] * e12 + T[10] * e22,
        T[11] + T[8] * tx + T[9] * ty + T[10] * tz,
    )


@compiled
def between(a: Pose, b: Pose) -> Step:
    """log(a^-1 b), for turns of less than pi."""
    trace = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6]
    trace += a[8] * b[8] + a[9] * b[9] + a[10] * b[10]
    sx = a[2] * b[1] - a[1] * b[2] + a[6] * b[5] - a[5] * b[6] + a[10] * b[9] - a[9] * b[10]
    sy = a[0] * b[2] - a[2] * b[0] + a[4] * b[6] - a[6] * b[4] + a[8] * b[10] - a[10] * b[8]
    sz = a[1] * b[0] - a[0] * b[1] + a[5] * b[4] - a[4] * b[5] + a[9] * b[8] - a[8] * b[9]
    dx, dy, dz = b[3] - a[3], b[7] - a[7], b[11] - a[11]
    u = a[0] * dx + a[4] * dy + a[8] * dz
    v = a[1] * dx + a[5] * dy + a[9] * dz
    w = a[2] * dx + a[6] * dy + a[10] * dz
    sine = 0.5 * math.sqrt(sx * sx + sy * sy + sz * sz)
    angle = math.atan2(sine, 0.5 * (trace - 1.0))
    small = angle < _SMALL_ANGLE
    scale = 0.5 + angle * angle / 12.0 if small else 0.5 * angle / sine
    x, y, z = scale * sx, scale * sy, scale * sz
    square = x * x + y * y + z * z
    half = 0.5 * angle
    rest = 1.0 / 12.0 + square / 720.0
    if not small:
        rest = (1.0 - half * math.cos(half) / math.sin(half)) / square
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    return (
        u - 0.5 * cx + rest * (y * cz - z * cy),
        v - 0.5 * cy + rest * (z * cx - x * cz),
        w - 0.5 * cz + rest * (x * cy - y * cx),
        x,
        y,
        z,
    )


@compiled
def orthonormal(T: Pose) -> Pose:
    """One Newton step towards the nearest rotation: R <- R (3 - R^T R) / 2."""
    g00 = T[0] * T[0] + T[4] * T[4] + T[8] * T[8]
    g11 = T[1] * T[1] + T[5] * T[5] + T[9] * T[9]
    g22 = T[2] * T[2] + T[6] * T[6] + T[10] * T[10]
    g01 = T[0] * T[1] + T[4] * T[5] + T[8] * T[9]
    g02 = T[0] * T[2] + T[4] * T[6] + T[8] * T[10]
    g12 = T[1] * T[2] + T[5] * T[6] + T[9] * T[10]
    a, b, c = 1.5 - 0.5 * g00, 1.5 - 0.5 * g11, 1.5 - 0.5 * g22
    d, e, f = -0.5 * g01, -0.5 * g02, -0.5 * g12
    return (
        T[0] * a + T[1] * d + T[2] * e, T[0] * d + T[1] * b + T[2] * f,
        T[0] * e + T[1] * f + T[2] * c, T[3],
        T[4] * a + T[5] * d + T[6] * e, T[4] * d + T[5] * b + T[6] * f,
        T[4] * e + T[5] * f + T[6] * c, T[7],
        T[8] * a + T[9] * d + T[10] * e, T[8] * d + T[9] * b + T[10] * f,
        T[8] * e + T[9] * f + T[10] * c, T[11],
    )  # fmt: skip
