"""Robust weights of odometry steps, found before they are linearised."""

import math

from tagmap.conventions import Array
from tagmap.estimation.kernels.layout import Steps
from tagmap.estimation.kernels.motion import logarithm, position_of, rotation_of
from tagmap.estimation.kernels.sightings import truncated
from tagmap.estimation.kernels.small import product, subtract, transpose, transposed_times
from tagmap.geometry.kernels.compiled import compiled


@compiled
def weigh_steps(
    steps: Steps, T: Array, mu: float, c2: float, least: float, old: Array, new: Array, r2: Array
) -> float:
    """Set new and r2 (N - 1,) of odometry at poses T (N, 4, 4); the cost at the weights `old`.

    mu as for sightings. A weight is never less than `least`: the chain must not fall apart where
    nothing else says how its parts lie to each other. There the step is met, and counts in full.
    """
    cost = 0.0
    for i in range(len(T) - 1):
        new[i] = 1.0
        r2[i] = 0.0
        if steps.has[i] == 0:
            continue
        R_m = rotation_of(steps.T[i])
        R_i = rotation_of(T[i])
        moved = transposed_times(R_i, subtract(position_of(T[i + 1]), position_of(T[i])))
        t = transposed_times(R_m, subtract(moved, position_of(steps.T[i])))
        R = product(transpose(R_m), product(transpose(R_i), rotation_of(T[i + 1])))
        v, w = logarithm(R, t)
        r = v[0], v[1], v[2], w[0], w[1], w[2]
        square = 0.0
        for a in range(6):
            pull = 0.0
            for b in range(6):
                pull += steps.information[i, a, b] * r[b]
            square += r[a] * pull
        r2[i] = square
        cost += old[i] * square
        weight = old[i] if mu < 0.0 else truncated(square, c2, mu)
        new[i] = max(weight, least) if square < math.inf else least
    return cost
