"""What calibration unknowns do to the prediction of a sighting and of an odometry step.

Which is which: tagmap.estimation.unknowns, whose order the codes here follow.
"""

from typing import NamedTuple

from tagmap.conventions import Array, Index
from tagmap.estimation.kernels.forms import STEREO_PX, Four, inner, whitened
from tagmap.estimation.kernels.layout import Linear, Sighted, Steps
from tagmap.estimation.kernels.motion import (
    exponential,
    inverse_right_jacobian,
    logarithm,
    position_of,
    right_jacobian,
    rotation_of,
)
from tagmap.estimation.kernels.small import (
    M,
    V,
    add,
    cross,
    dot,
    product,
    subtract,
    times,
    transpose,
    transposed_times,
)
from tagmap.geometry.kernels.compiled import compiled, inlined, internal

Six = tuple[float, float, float, float, float, float]

RANGE_SCALE, STEREO_SCALE, DISPARITY, CAMERA, TIME_OFFSET = 0, 1, 2, 3, 9
PRINCIPAL_U, PRINCIPAL_V = 12, 13


class Sensor(NamedTuple):
    """The values that one sighting depends on: p_cam as seen is scale exp(-camera) p_cam.

    offset: of the pixels as seen. R, t: exp(-camera). A, B: blocks of its right Jacobian at
    `camera`.
    """

    scale: float
    offset: Four
    delay: float
    R: M
    t: V
    A: M
    B: M


@internal
def as_stated() -> Sensor:
    """A sensor without unknowns."""
    one, zero = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Sensor(1.0, (0.0, 0.0, 0.0, 0.0), 0.0, one, zero, one, none)


@internal
def sensor_of(sighted: Sighted, block: int, calibration: Array) -> Sensor:
    """Of the sightings of that block."""
    scale, disparity, delay, du, dv = 1.0, 0.0, 0.0, 0.0, 0.0
    x = y = z = rx = ry = rz = 0.0
    for n in range(sighted.columns.shape[1]):
        column = sighted.columns[block, n]
        if column < 0:
            continue
        kind, value = sighted.kinds[block, n], calibration[column]
        if kind <= STEREO_SCALE:
            scale *= value
        elif kind == DISPARITY:
            disparity = value
        elif kind == TIME_OFFSET:
            delay = value
        elif kind == PRINCIPAL_U:
            du = value
        elif kind == PRINCIPAL_V:
            dv = value
        elif kind == CAMERA:
            x = value
        elif kind == CAMERA + 1:
            y = value
        elif kind == CAMERA + 2:
            z = value
        elif kind == CAMERA + 3:
            rx = value
        elif kind == CAMERA + 4:
            ry = value
        else:
            rz = value
    R, t = exponential((-x, -y, -z), (-rx, -ry, -rz))
    A, B = right_jacobian((x, y, z), (rx, ry, rz))
    return Sensor(scale, (du, dv, du - disparity, dv), delay, R, t, A, B)


@inlined
def mount_of(sighted: Sighted, k: int, sensor: Sensor, T_cam_base: Array) -> tuple[M, V]:
    """R and t of the camera as it is, from base at the time stamp: exp(-c) T exp(-delay twist)."""
    R = product(sensor.R, rotation_of(T_cam_base))
    t = add(times(sensor.R, position_of(T_cam_base)), sensor.t)
    if sensor.delay == 0.0:
        return R, t
    f = -sensor.delay
    v, w = _twist(sighted, k)
    R_moved, t_moved = exponential((f * v[0], f * v[1], f * v[2]), (f * w[0], f * w[1], f * w[2]))
    return product(R, R_moved), add(times(R, t_moved), t)


@inlined
def _twist(sighted: Sighted, k: int) -> tuple[V, V]:
    twist = sighted.twist
    return (twist[k, 0], twist[k, 1], twist[k, 2]), (twist[k, 3], twist[k, 4], twist[k, 5])


@inlined
def add_sensor(
    sighted: Sighted,
    k: int,
    i: int,
    w: float,
    sensor: Sensor,
    calibration: Array,
    point: tuple[V, M, V, V],
    r: Four,
    rows: tuple[V, V, V, V],
    by_point: tuple[Four, Four, Four],
    by: Array,
    linear: Linear,
) -> None:
    """What sighting k from pose i says of its unknowns, and of them with pose and tag.

    point: p_cam, scaled already, R_cam_base as it is, p_base and q. rows: of the Jacobian by p_cam;
    by_point: its whitened columns by the point in axes of the map, but for the scale.
    by (q, 4) is for work.
    """
    p_cam, R_cam_base, p_base, q = point
    t, how = sighted.tag[k], sighted.how[k]
    own = sighted.block[how]
    n_unknowns = sighted.columns.shape[1]
    a, b, c, d = rows
    f = w * sensor.scale
    second = 1.0 if sighted.form[own] == STEREO_PX else 0.0
    for u in range(n_unknowns):
        column = sighted.columns[own, u]
        if column < 0:
            continue
        kind = sighted.kinds[own, u]
        if kind == DISPARITY:
            raw = 0.0, 0.0, -1.0, 0.0
        elif kind == PRINCIPAL_U:
            raw = 1.0, 0.0, second, 0.0
        elif kind == PRINCIPAL_V:
            raw = 0.0, 1.0, 0.0, second
        else:
            m = _motion(sighted, k, kind, sensor, calibration[column], p_cam, R_cam_base, p_base)
            raw = dot(a, m), dot(b, m), dot(c, m), dot(d, m)
        x = whitened(sighted.whiten, how, raw)
        by[u, 0], by[u, 1], by[u, 2], by[u, 3] = x
        h = f * inner(by_point[0], x), f * inner(by_point[1], x), f * inner(by_point[2], x)
        turned = cross(q, h)
        slot = slot_of(linear, i, column)
        for e in range(3):
            linear.tag_calibration[t, e, column] += h[e]
            linear.pose_calibration[i, e, slot] -= h[e]
            linear.pose_calibration[i, 3 + e, slot] -= turned[e]
        linear.calibration_gradient[column] += w * inner(x, r)
        for v in range(u + 1):
            other = sighted.columns[own, v]
            if other < 0:
                continue
            y = by[v, 0], by[v, 1], by[v, 2], by[v, 3]
            both = w * inner(x, y)
            linear.calibration[column, other] += both
            if v != u:
                linear.calibration[other, column] += both


@inlined
def slot_of(linear: Linear, pose: int, column: int) -> int:
    """Which of the pose's slots is that column."""
    slot = 0
    while linear.slot_column[pose, slot] != column:
        slot += 1
    return slot


@inlined
def _motion(
    sighted: Sighted,
    k: int,
    kind: int,
    sensor: Sensor,
    value: float,
    p_cam: V,
    R_cam_base: M,
    p_base: V,
) -> V:
    """How the scaled point in cam moves with an unknown."""
    if kind <= STEREO_SCALE:
        return p_cam[0] / value, p_cam[1] / value, p_cam[2] / value
    s = sensor.scale
    if kind == TIME_OFFSET:
        v, w = _twist(sighted, k)
        e = times(R_cam_base, add(v, cross(w, p_base)))
        return -s * e[0], -s * e[1], -s * e[2]
    axis = kind - CAMERA
    if axis < 3:
        return -s * sensor.A[axis], -s * sensor.A[3 + axis], -s * sensor.A[6 + axis]
    axis -= 3
    turn = sensor.A[axis], sensor.A[3 + axis], sensor.A[6 + axis]
    e = cross(turn, p_cam)
    x, y, z = sensor.B[axis], sensor.B[3 + axis], sensor.B[6 + axis]
    return -(s * x + e[0]), -(s * y + e[1]), -(s * z + e[2])


@internal
def scales_of(columns: Index, i: int, calibration: Array) -> tuple[float, float]:
    """Of the lengths and of the turns of one step."""
    length = calibration[columns[i, 0]] if columns[i, 0] >= 0 else 1.0
    turn = calibration[columns[i, 1]] if columns[i, 1] >= 0 else 1.0
    return length, turn


@compiled
def _tangent(T: Array, length: float, turn: float) -> tuple[V, V]:
    """Of a measured step, the scales taken out."""
    v, w = logarithm(rotation_of(T), position_of(T))
    return (v[0] / length, v[1] / length, v[2] / length), (w[0] / turn, w[1] / turn, w[2] / turn)


@compiled
def corrected_steps(steps: Steps, calibration: Array, out: Array) -> None:
    """out (E, 4, 4): the steps, the scales taken out."""
    for i in range(len(steps.row)):
        row = steps.row[i]
        if row < 0:
            continue
        length, turn = scales_of(steps.columns, i, calibration)
        v, w = _tangent(steps.T[row], length, turn)
        R, t = exponential(v, w)
        for a in range(3):
            for b in range(3):
                out[row, a, b] = R[3 * a + b]
            out[row, a, 3], out[row, 3, a] = t[a], 0.0
        out[row, 3, 3] = 1.0


@compiled
def add_steps(
    steps: Steps, corrected: Array, weight: Array, calibration: Array, linear: Linear
) -> None:
    """What odometry at weights (N - 1,) says of its unknowns, and of them with poses.

    With the corrected tangent y the residual is log(exp(-y) S). It changes by -Jl^-1(r) Jr(y) dy,
    and a scale s changes the part of y that it divides by -y / s.
    """
    T = linear.T
    for i in range(len(steps.row)):
        a, b, row = steps.columns[i, 0], steps.columns[i, 1], steps.row[i]
        if row < 0 or (a < 0 and b < 0):
            continue
        R_i, R_j, R_m = rotation_of(T[i]), rotation_of(T[i + 1]), rotation_of(corrected[row])
        q = subtract(position_of(T[i + 1]), position_of(T[i]))
        t = transposed_times(R_m, subtract(transposed_times(R_i, q), position_of(corrected[row])))
        v, w = logarithm(product(transpose(R_m), product(transpose(R_i), R_j)), t)
        r = v[0], v[1], v[2], w[0], w[1], w[2]
        length, turn = scales_of(steps.columns, i, calibration)
        y, z = _tangent(steps.T[row], length, turn)
        zero = (0.0, 0.0, 0.0)
        by_length = _by_scale(y, z, (y[0] / length, y[1] / length, y[2] / length), zero, v, w)
        by_turn = _by_scale(y, z, zero, (z[0] / turn, z[1] / turn, z[2] / turn), v, w)
        R_map = transpose(R_j)
        A, B = inverse_right_jacobian(v, w)
        A, B = product(A, R_map), product(B, R_map)
        Q, f = steps.information[steps.how[row]], weight[i]
        h_length, h_turn = _informed(Q, f, by_length), _informed(Q, f, by_turn)
        if a >= 0:
            _add_step(a, i, 0, by_length, h_length, r, A, B, q, linear)
        if b >= 0:
            _add_step(b, i, 1, by_turn, h_turn, r, A, B, q, linear)
        if a >= 0 and b >= 0:
            both = _dot6(by_length, h_turn)
            linear.calibration[a, b] += both
            linear.calibration[b, a] += both
            linear.step_corner[i, 0, 1] = linear.step_corner[i, 1, 0] = both


@compiled
def _by_scale(y: V, z: V, dy: V, dz: V, v: V, w: V) -> Six:
    """Jl^-1(v, w) Jr(y, z) (dy, dz)."""
    A, B = right_jacobian(y, z)
    a, b = add(times(A, dy), times(B, dz)), times(A, dz)
    A, B = inverse_right_jacobian((-v[0], -v[1], -v[2]), (-w[0], -w[1], -w[2]))
    c, d = add(times(A, a), times(B, b)), times(A, b)
    return c[0], c[1], c[2], d[0], d[1], d[2]


@compiled
def _informed(Q: Array, weight: float, x: Six) -> Six:
    """weight Q x."""
    a, b, c, d, e, f = x
    a, b, c, d, e, f = weight * a, weight * b, weight * c, weight * d, weight * e, weight * f
    return (
        Q[0, 0] * a + Q[0, 1] * b + Q[0, 2] * c + Q[0, 3] * d + Q[0, 4] * e + Q[0, 5] * f,
        Q[1, 0] * a + Q[1, 1] * b + Q[1, 2] * c + Q[1, 3] * d + Q[1, 4] * e + Q[1, 5] * f,
        Q[2, 0] * a + Q[2, 1] * b + Q[2, 2] * c + Q[2, 3] * d + Q[2, 4] * e + Q[2, 5] * f,
        Q[3, 0] * a + Q[3, 1] * b + Q[3, 2] * c + Q[3, 3] * d + Q[3, 4] * e + Q[3, 5] * f,
        Q[4, 0] * a + Q[4, 1] * b + Q[4, 2] * c + Q[4, 3] * d + Q[4, 4] * e + Q[4, 5] * f,
        Q[5, 0] * a + Q[5, 1] * b + Q[5, 2] * c + Q[5, 3] * d + Q[5, 4] * e + Q[5, 5] * f,
    )


@compiled
def _dot6(a: Six, b: Six) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@compiled
def _add_step(
    column: int,
    i: int,
    which: int,
    by: Six,
    h: Six,
    r: Six,
    A: M,
    B: M,
    q: V,
    linear: Linear,
) -> None:
    """One unknown of one step, h = Q by.

    [[A, B], [0, A]]: the residual by pose i + 1, in axes of the map.
    """
    linear.step_corner[i, which, which] = _dot6(by, h)
    linear.calibration[column, column] += linear.step_corner[i, which, which]
    linear.calibration_gradient[column] += _dot6(r, h)
    s, u = (h[0], h[1], h[2]), (h[3], h[4], h[5])
    gv = transposed_times(A, s)
    gw = add(transposed_times(B, s), transposed_times(A, u))
    turned = add(gw, cross(q, gv))
    here, there = slot_of(linear, i, column), slot_of(linear, i + 1, column)
    for a in range(3):
        linear.step_calibration[i, a, which] = gv[a]
        linear.step_calibration[i, 3 + a, which] = gw[a]
        linear.pose_calibration[i + 1, a, there] += gv[a]
        linear.pose_calibration[i + 1, 3 + a, there] += gw[a]
        linear.pose_calibration[i, a, here] -= gv[a]
        linear.pose_calibration[i, 3 + a, here] -= turned[a]
