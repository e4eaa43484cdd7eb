"""Odometry, linearised into the block tridiagonal system of the poses."""

import math

from tagmap.conventions import Array
from tagmap.estimation.kernels import plane
from tagmap.estimation.kernels.layout import Linear, Steps
from tagmap.estimation.kernels.motion import (
    inverse_right_jacobian,
    logarithm,
    position_of,
    rotation_of,
)
from tagmap.estimation.kernels.sightings import truncated
from tagmap.estimation.kernels.small import (
    add,
    cross,
    difference_of,
    dot,
    full,
    hat_times,
    product,
    scaled,
    scaled_matrix,
    scaled_symmetric,
    subtract,
    sum_of,
    symmetric_times,
    times,
    times_hat,
    transpose,
    transposed_times,
)
from tagmap.geometry.kernels.compiled import compiled


@compiled
def linearise_steps(
    steps: Steps,
    mu: float,
    c2: float,
    least: float,
    weight: Array,
    new_weight: Array,
    r2: Array,
    model: bool,
    linear: Linear,
) -> tuple[float, float]:
    """Add odometry to diagonal and pose_gradient, set following; the cost at old and new weights.

    The residual is log(T_prev_cur^-1 T_i^-1 T_i+1). Moving poses i and i + 1 as one rigid body does
    not change it, so its Hessian by pose i is that by i + 1, carried over the lever between them.
    weight, new_weight, r2 (N - 1,): of each step; mu as for sightings, of which c2 is the bound. A
    weight is never less than `least`: the chain must not fall apart where nothing else says how its
    parts lie to each other. There the step is met, and counts in full. model: whether more than
    costs, weights and r2 is asked for.
    """
    T = linear.T
    D, off, g6 = linear.diagonal, linear.following, linear.pose_gradient
    cost = new_cost = 0.0
    for i in range(len(steps.row)):
        row = steps.row[i]
        if row < 0:
            off[i, :, :] = 0.0
            new_weight[i], r2[i] = 1.0, 0.0
            continue
        if len(steps.flat):
            r, turn = plane.step_residual(T, i, steps.T, row)
            F, n = steps.flat, steps.how[row]
            flat = F[n, 0], F[n, 1], F[n, 2], F[n, 3], F[n, 4], F[n, 5]
            square = dot(r, symmetric_times(flat, r))
            f = _weight(weight[i], square, mu, c2, least)
            cost += weight[i] * square
            new_cost += f * square
            r2[i], new_weight[i] = square, f
            if model:
                plane.add_step(i, r, turn, scaled_symmetric(f, flat), linear)
            continue
        measured = steps.T[row]
        R_i, R_j, R_m = rotation_of(T[i]), rotation_of(T[i + 1]), rotation_of(measured)
        q = subtract(position_of(T[i + 1]), position_of(T[i]))
        t = transposed_times(R_m, subtract(transposed_times(R_i, q), position_of(measured)))
        R = product(transpose(R_m), product(transpose(R_i), R_j))
        v, w = logarithm(R, t)
        Q = steps.information[steps.how[row]]
        vv = Q[0, 0], Q[0, 1], Q[0, 2], Q[1, 1], Q[1, 2], Q[2, 2]
        ww = Q[3, 3], Q[3, 4], Q[3, 5], Q[4, 4], Q[4, 5], Q[5, 5]
        vw = (
            Q[0, 3],
            Q[0, 4],
            Q[0, 5],
            Q[1, 3],
            Q[1, 4],
            Q[1, 5],
            Q[2, 3],
            Q[2, 4],
            Q[2, 5],
        )
        s = add(symmetric_times(vv, v), times(vw, w))
        u = add(transposed_times(vw, v), symmetric_times(ww, w))
        square = dot(s, v) + dot(u, w)
        f = _weight(weight[i], square, mu, c2, least)
        cost += weight[i] * square
        new_cost += f * square
        r2[i], new_weight[i] = square, f
        if not model:
            continue
        A, B = inverse_right_jacobian(v, w)
        R_map = transpose(R_j)
        A, B = product(A, R_map), product(B, R_map)
        s, u = scaled(f, s), scaled(f, u)
        gv = transposed_times(A, s)
        gw = add(transposed_times(B, s), transposed_times(A, u))
        left, right = product(full(vv), A), sum_of(product(full(vv), B), product(vw, A))
        low = sum_of(product(transpose(vw), B), product(full(ww), A))
        At, Bt = scaled_matrix(f, transpose(A)), scaled_matrix(f, transpose(B))
        Kvv, Kvw = product(At, left), product(At, right)
        Kww = sum_of(product(Bt, right), product(At, low))
        # carried to pose i: v_j = v_i - q x omega_i
        Cvw = difference_of(Kvw, times_hat(Kvv, q))
        Cww = difference_of(Kww, times_hat(transpose(Kvw), q))
        Eww = sum_of(Cww, hat_times(q, Cvw))
        for a in range(3):
            g6[i + 1, a] += gv[a]
            g6[i + 1, 3 + a] += gw[a]
            g6[i, a] -= gv[a]
            for b in range(3):
                n, m = 3 * a + b, 3 * b + a
                D[i + 1, a, b] += Kvv[n]
                D[i + 1, a, 3 + b] += Kvw[n]
                D[i + 1, 3 + a, b] += Kvw[m]
                D[i + 1, 3 + a, 3 + b] += Kww[n]
                off[i, a, b] = -Kvv[n]
                off[i, a, 3 + b] = -Cvw[n]
                off[i, 3 + a, b] = -Kvw[m]
                off[i, 3 + a, 3 + b] = -Cww[n]
                D[i, a, b] += Kvv[n]
                D[i, a, 3 + b] += Cvw[n]
                D[i, 3 + a, b] += Cvw[m]
                D[i, 3 + a, 3 + b] += Eww[n]
        turned = add(gw, cross(q, gv))
        for a in range(3):
            g6[i, 3 + a] -= turned[a]
    return cost, new_cost


@compiled
def _weight(old: float, square: float, mu: float, c2: float, least: float) -> float:
    f = old if mu < 0.0 else truncated(square, c2, mu)
    return max(f, least) if square < math.inf else least
