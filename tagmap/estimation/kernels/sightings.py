"""Sightings, linearised: each is condensed to what the solver needs, whatever its form.

In axes of the map a sighting of tag x from pose (v, omega) sees the displacement
e = x - v - omega x q with q = p_tag - t_pose; its part of the cost is e' W e + 2 g' e + r2.
Of each is kept W (`seen`: its upper triangle row by row); the sums over poses and tags take the
rest.
"""

import math

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.kernels.calibration import add_sensor, as_stated, mount_of, sensor_of
from tagmap.estimation.kernels.forms import Four, columns, inner, predict, residual, whitened
from tagmap.estimation.kernels.layout import Linear, Sighted
from tagmap.estimation.kernels.motion import position_of, rotation_of
from tagmap.estimation.kernels.small import (
    M,
    S,
    V,
    add,
    cross,
    difference_of,
    full,
    hat_times,
    product,
    subtract,
    times,
    times_hat,
    transpose,
)
from tagmap.geometry.kernels.compiled import compiled, inlined, internal

PLAIN, KEEP, CUT = -2.0, -1.0, math.inf

Sums = tuple[S, M, M, V, V]
"""Of one pose: the blocks vv, vw, ww of its normal equations, and its gradient by v and omega."""


@compiled
def linearise_sightings(
    sighted: Sighted,
    calibration: Array,
    mu: float,
    weight: Array,
    new_weight: Array,
    r2: Array,
    model: bool,
    linear: Linear,
) -> tuple[float, float]:
    """Set seen, diagonal and pose_gradient at the new weights, add to what tags and unknowns have.

    Returns the cost at the old and at the new weights. calibration (Q,): values of the unknowns.
    mu: KEEP leaves the weights as they are, PLAIN makes them 1 where the tag can be measured, else
    they are those of graduated truncated least squares, CUT being 0 or 1. weight, new_weight,
    r2 (K,). model: whether more than these is asked for.
    """
    p, T, seen, whiten = linear.p, linear.T, linear.seen, sighted.whiten
    by_tag, g3 = linear.tag_diagonal, linear.tag_gradient
    cost = new_cost = 0.0
    calibrated, last, scale = sighted.columns.shape[1] > 0, -1, 1.0
    sensor = as_stated()
    offset = sensor.offset
    by = np.empty((sighted.columns.shape[1], 4))
    for i in range(len(T)):
        R_base, t_base = transpose(rotation_of(T[i])), position_of(T[i])
        R, t_mount, R_mount, before = R_base, t_base, R_base, -1
        sums = nothing()
        for k in range(linear.first[i], linear.first[i + 1]):
            t, how = sighted.tag[k], sighted.how[k]
            block = sighted.block[how]
            if calibrated or how != before:
                mount = sighted.T_cam_base[sighted.mount[how]]
                R_mount, t_mount, before = rotation_of(mount), position_of(mount), how
                if calibrated:
                    if block != last:
                        last, sensor = block, sensor_of(sighted, block, calibration)
                        scale, offset = sensor.scale, sensor.offset
                    R_mount, t_mount = mount_of(sighted, k, sensor, mount)
                R = product(R_mount, R_base)
            q = subtract((p[t, 0], p[t, 1], p[t, 2]), t_base)
            cam = add(times(R, q), t_mount)
            cam = scale * cam[0], scale * cam[1], scale * cam[2]
            square, r, rows = observe(
                sighted.form[block], sighted.rigs[block], cam, offset, sighted.z, k, whiten, how
            )
            r2[k] = square
            if weight[k] > 0.0:
                cost += weight[k] * square
            w = 1.0 if mu == PLAIN else weight[k]
            if mu >= 0.0:
                w = truncated(square, sighted.c2[block], mu)
            if not (square < math.inf and w > 0.0):
                new_weight[k] = 0.0
                for n in range(6):
                    seen[k, n] = 0.0
                continue
            new_weight[k] = w
            new_cost += w * square
            if not model:
                continue
            x, y, z = by_point(whiten, how, rows, R)
            W, g = condensed(w, scale, x, y, z, r)
            for n in range(6):
                seen[k, n] = W[n]
            add_to_tag(by_tag, g3, t, W, g)
            sums = with_view(sums, W, q, g)
            if calibrated:
                seen_as = cam, R_mount, times(R_base, q), q
                add_sensor(
                    sighted, k, i, w, sensor, calibration, seen_as, r, rows, (x, y, z), by, linear
                )
        set_pose(linear.diagonal[i], linear.pose_gradient[i], sums)
    for t in range(len(p)):
        mirror(by_tag[t])
    return cost, new_cost


@inlined
def observe(
    form: int, rig: Array, cam: V, offset: Four, z: Array, k: int, whiten: Array, how: int
) -> tuple[float, Four, tuple[V, V, V, V]]:
    """Squared whitened residual, inf where cam cannot be measured; residual, Jacobian by cam."""
    valid, h, a, b, c, d = predict(form, rig, cam)
    h = h[0] + offset[0], h[1] + offset[1], h[2] + offset[2], h[3] + offset[3]
    r = whitened(whiten, how, residual(form, h, z, k))
    square = inner(r, r)
    if not (valid and square < math.inf):
        square = math.inf
    return square, r, (a, b, c, d)


@inlined
def by_point(whiten: Array, how: int, rows: tuple[V, V, V, V], R: M) -> tuple[Four, Four, Four]:
    """Whitened columns of the Jacobian by the point in axes that R turns into those of cam."""
    x, y, z = columns(rows[0], rows[1], rows[2], rows[3], R)
    return whitened(whiten, how, x), whitened(whiten, how, y), whitened(whiten, how, z)


@inlined
def condensed(w: float, scale: float, x: Four, y: Four, z: Four, r: Four) -> tuple[S, V]:
    """W and g."""
    f = w * scale
    g = f * inner(x, r), f * inner(y, r), f * inner(z, r)
    f *= scale
    return (
        f * inner(x, x),
        f * inner(x, y),
        f * inner(x, z),
        f * inner(y, y),
        f * inner(y, z),
        f * inner(z, z),
    ), g


@internal
def truncated(square: float, c2: float, mu: float) -> float:
    """Weight 0..1 of a squared residual: see tagmap.estimation.robust."""
    if mu == math.inf:
        return 1.0 if square <= c2 else 0.0
    if not square < math.inf:
        return 0.0
    w = math.sqrt(c2 * mu * (mu + 1.0) / max(square, 1e-30)) - mu
    return min(max(w, 0.0), 1.0)


@inlined
def nothing() -> Sums:
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), none, none, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


@inlined
def with_view(sums: Sums, W: S, q: V, g: V) -> Sums:
    """What one sighting says of its pose, added."""
    vv, vw, ww, gv, gw = sums
    Wq = times_hat(full(W), q)
    return (
        (vv[0] + W[0], vv[1] + W[1], vv[2] + W[2], vv[3] + W[3], vv[4] + W[4], vv[5] + W[5]),
        difference_of(vw, Wq),
        difference_of(ww, hat_times(q, Wq)),
        subtract(gv, g),
        subtract(gw, cross(q, g)),
    )


@inlined
def set_pose(D: Array, g6: Array, sums: Sums) -> None:
    vv, vw, ww, gv, gw = sums
    n = 0
    for a in range(3):
        g6[a], g6[3 + a] = gv[a], gw[a]
        for b in range(a, 3):
            D[a, b] = D[b, a] = vv[n]
            D[3 + a, 3 + b] = D[3 + b, 3 + a] = ww[3 * a + b]
            n += 1
        for b in range(3):
            D[a, 3 + b] = D[3 + b, a] = vw[3 * a + b]


@inlined
def add_to_tag(D: Array, g3: Array, t: int, W: S, g: V) -> None:
    """Into D (M, 3, 3), the upper triangle, and g3 (M, 3)."""
    n = 0
    for a in range(3):
        g3[t, a] += g[a]
        for b in range(a, 3):
            D[t, a, b] += W[n]
            n += 1


@internal
def mirror(A: Array) -> None:
    """The lower triangle from the upper one."""
    for a in range(len(A)):
        for b in range(a):
            A[a, b] = A[b, a]
