"""Sightings, linearised: each is condensed to what the solver needs, whatever its form.

In axes of the map a sighting of tag x from pose (v, omega) sees the displacement
e = x - v - omega x q with q = p_tag - t_pose; its part of the cost is e' W e + 2 g' e + r2.
W, packed row by row, and q are one row (9,) of `seen`; nothing else of it is kept.
"""

import math

from tagmap.conventions import Array
from tagmap.estimation.kernels.forms import Four, columns, predict, residual, whitened
from tagmap.estimation.kernels.layout import Block, Linear
from tagmap.estimation.kernels.motion import position_of, rotation_of
from tagmap.estimation.kernels.small import V, add, cross, dot, product, subtract, times, transpose
from tagmap.geometry.kernels.compiled import compiled

KEEP, CUT = -1.0, math.inf
SCALE, DISPARITY = 0, 1


@compiled
def linearise_sightings(
    block: Block,
    T: Array,
    p: Array,
    calibration: Array,
    c2: float,
    mu: float,
    weight: Array,
    new_weight: Array,
    r2: Array,
    linear: Linear,
) -> tuple[float, float]:
    """Fill the rows of one block at its new weights; return its cost at the old and at the new.

    calibration (Q,): values of the unknowns. mu: KEEP leaves the weights as they are; else those of
    graduated truncated least squares with bound c2, CUT being 0 or 1. weight, new_weight, r2 (K,).
    """
    seen, gradient = linear.seen, linear.gradient
    scale, disparity = 1.0, 0.0
    for n in range(len(block.kinds)):
        if block.kinds[n] == SCALE:
            scale = calibration[block.columns[n]]
        elif block.kinds[n] == DISPARITY:
            disparity = calibration[block.columns[n]]
    cost = new_cost = 0.0
    for k in range(len(block.z)):
        i, t, m, at = block.pose[k], block.tag[k], block.mount[k], block.row[k]
        q = subtract((p[t, 0], p[t, 1], p[t, 2]), position_of(T[i]))
        mount = block.T_cam_base[m]
        R = product(rotation_of(mount), transpose(rotation_of(T[i])))
        cam = add(times(R, q), position_of(mount))
        cam = scale * cam[0], scale * cam[1], scale * cam[2]
        valid, z, a, b, c, d = predict(block.form, block.rig, cam)
        z = z[0], z[1], z[2] + disparity, z[3]
        r = whitened(block.whiten, k, residual(block.form, z, block.z, k))
        square = _dot(r, r)
        if not (valid and square < math.inf):
            square = math.inf
        r2[k] = square
        if weight[k] > 0.0:
            cost += weight[k] * square
        w = weight[k] if mu < 0.0 else truncated(square, c2, mu)
        if not square < math.inf:
            w = 0.0
        new_weight[k] = w
        seen[at, 6], seen[at, 7], seen[at, 8] = q
        if not w > 0.0:
            for n in range(6):
                seen[at, n] = 0.0
            gradient[at, 0] = gradient[at, 1] = gradient[at, 2] = 0.0
            continue
        new_cost += w * square
        x, y, z = columns(a, b, c, d, R)
        f = scale
        x, y, z = whitened(block.whiten, k, x), whitened(block.whiten, k, y), whitened(block.whiten, k, z)
        g = w * f * f
        seen[at, 0], seen[at, 1], seen[at, 2] = g * _dot(x, x), g * _dot(x, y), g * _dot(x, z)
        seen[at, 3], seen[at, 4], seen[at, 5] = g * _dot(y, y), g * _dot(y, z), g * _dot(z, z)
        g = w * f
        gradient[at, 0], gradient[at, 1] = g * _dot(x, r), g * _dot(y, r)
        gradient[at, 2] = g * _dot(z, r)
        if len(block.kinds):
            rows = a, b, c, d
            _add_calibration(block, k, w, f, cam, q, r, rows, (x, y, z), linear)
    return cost, new_cost


@compiled
def _dot(a: Four, b: Four) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@compiled
def truncated(square: float, c2: float, mu: float) -> float:
    """Weight 0..1 of a squared residual: see tagmap.estimation.robust."""
    if mu == math.inf:
        return 1.0 if square <= c2 else 0.0
    if not square < math.inf:
        return 0.0
    w = math.sqrt(c2 * mu * (mu + 1.0) / max(square, 1e-30)) - mu
    return min(max(w, 0.0), 1.0)


@compiled
def _add_calibration(
    block: Block,
    k: int,
    w: float,
    scale: float,
    cam: V,
    q: V,
    r: Four,
    rows: tuple[V, V, V, V],
    by_point: tuple[Four, Four, Four],
    linear: Linear,
) -> None:
    """What one sighting says of the calibration unknowns, and of them with its pose and tag.

    cam is scaled already; `rows` of the Jacobian by cam, `by_point` its whitened columns by the
    point in axes of the map, but for the scale.
    """
    i, t = block.pose[k], block.tag[k]
    for u in range(len(block.kinds)):
        by = _by_unknown(block, u, k, scale, cam, rows)
        column, slot = block.columns[u], block.slots[u]
        f = w * scale
        h = f * _dot(by_point[0], by), f * _dot(by_point[1], by), f * _dot(by_point[2], by)
        turned = cross(q, h)
        for a in range(3):
            linear.tag_calibration[t, a, column] += h[a]
            linear.pose_calibration[i, a, slot] -= h[a]
            linear.pose_calibration[i, 3 + a, slot] -= turned[a]
        for v in range(len(block.kinds)):
            also = _by_unknown(block, v, k, scale, cam, rows)
            linear.calibration[column, block.columns[v]] += w * _dot(by, also)
        linear.calibration_gradient[column] += w * _dot(by, r)


@compiled
def _by_unknown(
    block: Block, u: int, k: int, scale: float, cam: V, rows: tuple[V, V, V, V]
) -> Four:
    """Whitened derivative of one sighting by one calibration unknown."""
    if block.kinds[u] == SCALE:
        a, b, c, d = rows
        f = 1.0 / scale
        raw = f * dot(a, cam), f * dot(b, cam), f * dot(c, cam), f * dot(d, cam)
    else:
        raw = 0.0, 0.0, 1.0, 0.0
    return whitened(block.whiten, k, raw)
