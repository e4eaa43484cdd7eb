"""Sightings, linearised: each is condensed to what the solver needs, whatever its form.

In axes of the map a sighting of tag x from pose (v, omega) sees the displacement
e = x - v - omega x q with q = p_tag - t_pose; its part of the cost is e' W e + 2 g' e + r2.
W, its upper triangle row by row, and q are what `seen` (9,) keeps of it, and g (3,).
"""

import math

from tagmap.conventions import Array
from tagmap.estimation.kernels.forms import Four, columns, predict, residual, whitened
from tagmap.estimation.kernels.layout import Linear, Sighted
from tagmap.estimation.kernels.motion import position_of, rotation_of
from tagmap.estimation.kernels.small import V, add, cross, dot, product, subtract, times, transpose
from tagmap.geometry.kernels.compiled import compiled

KEEP, CUT = -1.0, math.inf
SCALE, DISPARITY = 0, 1


@compiled
def linearise_sightings(
    sighted: Sighted,
    T: Array,
    p: Array,
    calibration: Array,
    mu: float,
    weight: Array,
    new_weight: Array,
    r2: Array,
    linear: Linear,
) -> tuple[float, float]:
    """Fill seen and gradient at the new weights; return the cost at the old and at the new.

    calibration (Q,): values of the unknowns. mu: KEEP leaves the weights as they are; else those of
    graduated truncated least squares, CUT being 0 or 1. weight, new_weight, r2 (K,).
    """
    seen, gradient = linear.seen, linear.gradient
    cost = new_cost = 0.0
    for k in range(len(sighted.z)):
        i, t, m, form = sighted.pose[k], sighted.tag[k], sighted.mount[k], sighted.form[k]
        scale, disparity = _calibration(sighted, sighted.unknowns[k], calibration)
        q = subtract((p[t, 0], p[t, 1], p[t, 2]), position_of(T[i]))
        mount = sighted.T_cam_base[m]
        R = product(rotation_of(mount), transpose(rotation_of(T[i])))
        cam = add(times(R, q), position_of(mount))
        cam = scale * cam[0], scale * cam[1], scale * cam[2]
        valid, z, a, b, c, d = predict(form, sighted.rigs[sighted.rig[k]], cam)
        z = z[0], z[1], z[2] + disparity, z[3]
        r = whitened(sighted.whiten, k, residual(form, z, sighted.z, k))
        square = _dot(r, r)
        if not (valid and square < math.inf):
            square = math.inf
        r2[k] = square
        if weight[k] > 0.0:
            cost += weight[k] * square
        w = weight[k] if mu < 0.0 else truncated(square, sighted.c2[form], mu)
        if not square < math.inf:
            w = 0.0
        new_weight[k] = w
        if not w > 0.0:
            for n in range(9):
                seen[k, n] = 0.0
            gradient[k, 0] = gradient[k, 1] = gradient[k, 2] = 0.0
            continue
        new_cost += w * square
        seen[k, 6], seen[k, 7], seen[k, 8] = q
        x, y, z = columns(a, b, c, d, R)
        x, y = whitened(sighted.whiten, k, x), whitened(sighted.whiten, k, y)
        z = whitened(sighted.whiten, k, z)
        g = w * scale * scale
        seen[k, 0], seen[k, 1], seen[k, 2] = g * _dot(x, x), g * _dot(x, y), g * _dot(x, z)
        seen[k, 3], seen[k, 4], seen[k, 5] = g * _dot(y, y), g * _dot(y, z), g * _dot(z, z)
        g = w * scale
        gradient[k, 0], gradient[k, 1] = g * _dot(x, r), g * _dot(y, r)
        gradient[k, 2] = g * _dot(z, r)
        if sighted.columns.shape[1] > 0:
            rows = a, b, c, d
            _add_calibration(sighted, k, w, scale, cam, q, r, rows, (x, y, z), linear)
    return cost, new_cost


@compiled
def _calibration(sighted: Sighted, unknowns: int, calibration: Array) -> tuple[float, float]:
    """Scale and disparity offset of one sighting."""
    scale, disparity = 1.0, 0.0
    for n in range(sighted.columns.shape[1]):
        column = sighted.columns[unknowns, n]
        if column >= 0 and sighted.kinds[unknowns, n] == SCALE:
            scale = calibration[column]
        elif column >= 0 and sighted.kinds[unknowns, n] == DISPARITY:
            disparity = calibration[column]
    return scale, disparity


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
    sighted: Sighted,
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
    i, t, own = sighted.pose[k], sighted.tag[k], sighted.unknowns[k]
    for u in range(sighted.columns.shape[1]):
        column = sighted.columns[own, u]
        if column < 0:
            continue
        slot = 0
        while linear.slot_column[i, slot] != column:
            slot += 1
        by = _by_unknown(sighted, u, k, scale, cam, rows)
        f = w * scale
        h = f * _dot(by_point[0], by), f * _dot(by_point[1], by), f * _dot(by_point[2], by)
        turned = cross(q, h)
        for a in range(3):
            linear.tag_calibration[t, a, column] += h[a]
            linear.pose_calibration[i, a, slot] -= h[a]
            linear.pose_calibration[i, 3 + a, slot] -= turned[a]
        for v in range(sighted.columns.shape[1]):
            other = sighted.columns[own, v]
            if other >= 0:
                also = _by_unknown(sighted, v, k, scale, cam, rows)
                linear.calibration[column, other] += w * _dot(by, also)
        linear.calibration_gradient[column] += w * _dot(by, r)


@compiled
def _by_unknown(
    sighted: Sighted, u: int, k: int, scale: float, cam: V, rows: tuple[V, V, V, V]
) -> Four:
    """Whitened derivative of one sighting by one of its calibration unknowns."""
    if sighted.kinds[sighted.unknowns[k], u] == SCALE:
        a, b, c, d = rows
        f = 1.0 / scale
        raw = f * dot(a, cam), f * dot(b, cam), f * dot(c, cam), f * dot(d, cam)
    else:
        raw = 0.0, 0.0, 1.0, 0.0
    return whitened(sighted.whiten, k, raw)
