"""Lenses, compiled: where tagmap.geometry.camera is computed.

A camera is an array (9,) [fx, fy, cx, cy, k1, k2, p1, p2, k3]. A ray is (x / z, y / z).
"""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled, inlined

_STEPS = 10
# Newton's steps square: what is left after one this small is less than rounding.
_LAST_STEP = 1e-9
_TOLERANCE = 1e-10


@inlined
def bend(camera: Array, x: float, y: float) -> tuple[float, float, float, float, float]:
    """The distorted ray of an ideal one, and its symmetric Jacobian: 00, 01 and 11."""
    k1, k2, p1, p2, k3 = camera[4], camera[5], camera[6], camera[7], camera[8]
    xy, r2 = x * y, x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    return (
        x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * xy,
        radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        slope * xy + 2.0 * (p1 * x + p2 * y),
        radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    )


@compiled
def distort(camera: Array, ray: Array, distorted: Array, D: Array) -> None:
    """Of rays (N, 2), with D (N, 2, 2)."""
    for i in range(len(ray)):
        u, v, a, b, d = bend(camera, ray[i, 0], ray[i, 1])
        distorted[i, 0], distorted[i, 1] = u, v
        D[i, 0, 0], D[i, 0, 1], D[i, 1, 0], D[i, 1, 1] = a, b, b, d


@inlined
def is_ideal(camera: Array) -> bool:
    k = abs(camera[4]) + abs(camera[5]) + abs(camera[6]) + abs(camera[7]) + abs(camera[8])
    return bool(k == 0.0)


@compiled
def unbend(camera: Array, u: float, v: float) -> tuple[float, float]:
    """The ideal ray of a raw pixel by Newton's method; NaN where the model has no inverse."""
    s, t = (u - camera[2]) / camera[0], (v - camera[3]) / camera[1]
    if is_ideal(camera):
        return s, t
    x, y = s, t
    for _ in range(_STEPS):
        u, v, a, b, d = bend(camera, x, y)
        determinant = a * d - b * b
        dx = (d * (u - s) - b * (v - t)) / determinant
        dy = (a * (v - t) - b * (u - s)) / determinant
        x, y = x - dx, y - dy
        if abs(dx) + abs(dy) < _LAST_STEP:
            break
    u, v, a, b, d = bend(camera, x, y)
    # Past the fold of the radial polynomial a second, mirrored solution lies in wait.
    if abs(u - s) < _TOLERANCE and abs(v - t) < _TOLERANCE and a * d > b * b:
        return x, y
    return math.nan, math.nan


@compiled
def undistort(camera: Array, px: Array, ray: Array) -> None:
    """Of pixels (N, 2)."""
    for i in range(len(px)):
        ray[i, 0], ray[i, 1] = unbend(camera, px[i, 0], px[i, 1])


@compiled
def see(camera: Array, p: Array, px: Array, J: Array) -> None:
    """Pixel (2,) of a point (3,), with J (2, 3); NaN where it is not in front."""
    z = p[2] if p[2] > 0.0 else math.nan
    x, y = p[0] / z, p[1] / z
    u, v, a, b, d = bend(camera, x, y)
    fx, fy = camera[0], camera[1]
    px[0], px[1] = camera[2] + fx * u, camera[3] + fy * v
    a, b, c, d = fx * a / z, fx * b / z, fy * b / z, fy * d / z
    J[0, 0], J[0, 1], J[0, 2] = a, b, -(a * x + b * y)
    J[1, 0], J[1, 1], J[1, 2] = c, d, -(c * x + d * y)


@compiled
def project(camera: Array, p: Array, px: Array, J: Array) -> None:
    """Of points (N, 3) in cam."""
    for i in range(len(p)):
        see(camera, p[i], px[i], J[i])
