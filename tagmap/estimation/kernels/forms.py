"""The forms of a measurement with their Jacobians, one point at a time.

The same models as tagmap.geometry.measurement, which says what they mean. Every form has four
numbers here, the last ones zero where it has fewer. A rig is an array (30,): left camera (9,),
right camera (9,) as in tagmap.geometry.kernels.rays, R_right_left (9,), t (3,).
"""

import math

from tagmap.conventions import Array
from tagmap.estimation.kernels.small import M, V, times, transposed_times
from tagmap.geometry.kernels.compiled import inlined, internal

STEREO_PX, MONO_PX, POINT_M, RANGE_BEARING, RANGE_BEARING_PLANAR = 0, 1, 2, 3, 4
RIG_SIZE = 30

Four = tuple[float, float, float, float]


@inlined
def predict(form: int, rig: Array, p: V) -> tuple[bool, Four, V, V, V, V]:
    """Whether p_cam can be measured, z, and the rows of its Jacobian by the point."""
    zero = (0.0, 0.0, 0.0)
    if form == STEREO_PX:
        seen, u, v, a, b = _camera(rig, 0, p)
        R = (
            rig[18],
            rig[19],
            rig[20],
            rig[21],
            rig[22],
            rig[23],
            rig[24],
            rig[25],
            rig[26],
        )
        q = times(R, p)
        also, s, t, c, d = _camera(rig, 9, (q[0] + rig[27], q[1] + rig[28], q[2] + rig[29]))
        return seen and also, (u, v, s, t), a, b, transposed_times(R, c), transposed_times(R, d)
    if form == MONO_PX:
        seen, u, v, a, b = _camera(rig, 0, p)
        return seen, (u, v, 0.0, 0.0), a, b, zero, zero
    if form == POINT_M:
        x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        return True, (p[0], p[1], p[2], 0.0), x, y, z, zero
    distance = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
    if form == RANGE_BEARING:
        square = p[0] * p[0] + p[2] * p[2]
        bearing, turn = math.atan2(-p[0], p[2]), (-p[2] / square, 0.0, p[0] / square)
    else:
        square = p[0] * p[0] + p[1] * p[1]
        bearing, turn = math.atan2(p[1], p[0]), (-p[1] / square, p[0] / square, 0.0)
    along = p[0] / distance, p[1] / distance, p[2] / distance
    return square > 0.0, (distance, bearing, 0.0, 0.0), along, turn, zero, zero


@inlined
def _camera(rig: Array, at: int, p: V) -> tuple[bool, float, float, V, V]:
    """Pixel and its Jacobian by the point, of the camera at rig[at:]."""
    inverse = 1.0 / p[2]
    x, y = p[0] * inverse, p[1] * inverse
    fx, fy = rig[at], rig[at + 1]
    k1, k2, p1, p2, k3 = rig[at + 4], rig[at + 5], rig[at + 6], rig[at + 7], rig[at + 8]
    u, v, a, b, d = x, y, 1.0, 0.0, 1.0
    if k1 != 0.0 or k2 != 0.0 or p1 != 0.0 or p2 != 0.0 or k3 != 0.0:
        xy, r2 = x * y, x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
        u = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x * x)
        v = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * xy
        a = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
        d = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
        b = slope * xy + 2.0 * (p1 * x + p2 * y)
    ux, uy, vx, vy = fx * a * inverse, fx * b * inverse, fy * b * inverse, fy * d * inverse
    by_u, by_v = (ux, uy, -(ux * x + uy * y)), (vx, vy, -(vx * x + vy * y))
    return p[2] > 0.0, rig[at + 2] + fx * u, rig[at + 3] + fy * v, by_u, by_v


@inlined
def residual(form: int, predicted: Four, z: Array, k: int) -> Four:
    """predicted - z[k], bearings wrapped to [-pi, pi]."""
    a, b = predicted[0] - z[k, 0], predicted[1] - z[k, 1]
    if form >= RANGE_BEARING:
        b -= 2.0 * math.pi * math.floor(b / (2.0 * math.pi) + 0.5)
    return a, b, predicted[2] - z[k, 2], predicted[3] - z[k, 3]


@internal
def whitened(w: Array, k: int, x: Four) -> Four:
    """W x with the lower triangle w[k] (10,) of W, row by row."""
    return (
        w[k, 0] * x[0],
        w[k, 1] * x[0] + w[k, 2] * x[1],
        w[k, 3] * x[0] + w[k, 4] * x[1] + w[k, 5] * x[2],
        w[k, 6] * x[0] + w[k, 7] * x[1] + w[k, 8] * x[2] + w[k, 9] * x[3],
    )


@internal
def inner(a: Four, b: Four) -> float:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@internal
def columns(a: V, b: V, c: V, d: V, R: M) -> tuple[Four, Four, Four]:
    """The columns of the matrix of rows a, b, c, d, times R."""
    a, b = transposed_times(R, a), transposed_times(R, b)
    c, d = transposed_times(R, c), transposed_times(R, d)
    return (a[0], b[0], c[0], d[0]), (a[1], b[1], c[1], d[1]), (a[2], b[2], c[2], d[2])
