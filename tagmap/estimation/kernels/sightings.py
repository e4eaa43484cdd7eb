"""Sightings, linearised: each is condensed to what the solver needs, whatever its form.

In axes of the map a sighting of tag x from pose (v, omega) sees the displacement
e = x - v - omega x q with q = p_tag - t_pose; its part of the cost is e' W e + 2 g' e + r2.
W, its upper triangle row by row, and q are what `seen` (9,) keeps of it, and g (3,).
"""

import math

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.kernels.calibration import add_sensor, as_stated, mount_of, sensor_of
from tagmap.estimation.kernels.forms import columns, inner, predict, residual, whitened
from tagmap.estimation.kernels.layout import Linear, Sighted
from tagmap.estimation.kernels.motion import position_of, rotation_of
from tagmap.estimation.kernels.small import (
    add,
    product,
    subtract,
    times,
    transpose,
    transposed_times,
)
from tagmap.geometry.kernels.compiled import compiled

PLAIN, KEEP, CUT = -2.0, -1.0, math.inf


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

    calibration (Q,): values of the unknowns. mu: KEEP leaves the weights as they are, PLAIN
    makes them 1 where the tag can be measured, else they are those of
    graduated truncated least squares, CUT being 0 or 1. weight, new_weight, r2 (K,).
    """
    seen, gradient = linear.seen, linear.gradient
    cost = new_cost = 0.0
    calibrated, last, scale = sighted.columns.shape[1] > 0, -1, 1.0
    sensor = as_stated()
    by = np.empty((sighted.columns.shape[1], 4))
    for k in range(len(sighted.z)):
        i, t, form = sighted.pose[k], sighted.tag[k], sighted.form[k]
        q = subtract((p[t, 0], p[t, 1], p[t, 2]), position_of(T[i]))
        mount = sighted.T_cam_base[sighted.mount[k]]
        R_mount, t_mount = rotation_of(mount), position_of(mount)
        if calibrated:
            if sighted.unknowns[k] != last:
                last = sighted.unknowns[k]
                sensor = sensor_of(sighted, last, calibration)
                scale = sensor.scale
            R_mount, t_mount = mount_of(sighted, k, sensor, mount)
        R = product(R_mount, transpose(rotation_of(T[i])))
        cam = add(times(R, q), t_mount)
        cam = scale * cam[0], scale * cam[1], scale * cam[2]
        valid, z, a, b, c, d = predict(form, sighted.rigs[sighted.rig[k]], cam)
        z = z[0], z[1], z[2] - sensor.disparity, z[3]
        r = whitened(sighted.whiten, k, residual(form, z, sighted.z, k))
        square = inner(r, r)
        if not (valid and square < math.inf):
            square = math.inf
        r2[k] = square
        if weight[k] > 0.0:
            cost += weight[k] * square
        w = 1.0 if mu == PLAIN else weight[k]
        if mu >= 0.0:
            w = truncated(square, sighted.c2[form], mu)
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
        seen[k, 0], seen[k, 1], seen[k, 2] = g * inner(x, x), g * inner(x, y), g * inner(x, z)
        seen[k, 3], seen[k, 4], seen[k, 5] = g * inner(y, y), g * inner(y, z), g * inner(z, z)
        g = w * scale
        gradient[k, 0], gradient[k, 1] = g * inner(x, r), g * inner(y, r)
        gradient[k, 2] = g * inner(z, r)
        if calibrated:
            seen_as = cam, R_mount, transposed_times(rotation_of(T[i]), q), q
            add_sensor(
                sighted, k, w, sensor, calibration, seen_as, r, (a, b, c, d), (x, y, z), by, linear
            )
    return cost, new_cost


@compiled
def truncated(square: float, c2: float, mu: float) -> float:
    """Weight 0..1 of a squared residual: see tagmap.estimation.robust."""
    if mu == math.inf:
        return 1.0 if square <= c2 else 0.0
    if not square < math.inf:
        return 0.0
    w = math.sqrt(c2 * mu * (mu + 1.0) / max(square, 1e-30)) - mu
    return min(max(w, 0.0), 1.0)
