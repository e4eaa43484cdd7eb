"""Odometry and sightings gathered into the block tridiagonal system of the poses."""

from tagmap.conventions import Array
from tagmap.estimation.kernels.layout import Linear, Steps
from tagmap.estimation.kernels.motion import (
    inverse_right_jacobian,
    logarithm,
    position_of,
    rotation_of,
)
from tagmap.estimation.kernels.small import (
    add,
    cross,
    difference_of,
    dot,
    full,
    hat_times,
    product,
    subtract,
    sum_of,
    symmetric_times,
    times,
    times_hat,
    transpose,
    transposed_times,
    upper,
)
from tagmap.geometry.kernels.compiled import compiled


@compiled
def gather_sightings(linear: Linear) -> None:
    """Set diagonal and pose_gradient, add to tag_diagonal and tag_gradient, from all rows."""
    seen, gradient = linear.seen, linear.gradient
    D, g6 = linear.diagonal, linear.pose_gradient
    by_tag, g3 = linear.tag_diagonal, linear.tag_gradient
    for i in range(len(D)):
        vv = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        vw = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        ww = vw
        gv, gw = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for k in range(linear.first[i], linear.first[i + 1]):
            W = seen[k, 0], seen[k, 1], seen[k, 2], seen[k, 3], seen[k, 4], seen[k, 5]
            q = seen[k, 6], seen[k, 7], seen[k, 8]
            g = gradient[k, 0], gradient[k, 1], gradient[k, 2]
            t = linear.tag[k]
            n = 0
            for a in range(3):
                g3[t, a] += g[a]
                for b in range(a, 3):
                    by_tag[t, a, b] += W[n]
                    n += 1
            vv = (
                vv[0] + W[0],
                vv[1] + W[1],
                vv[2] + W[2],
                vv[3] + W[3],
                vv[4] + W[4],
                vv[5] + W[5],
            )
            Wq = times_hat(full(W), q)
            vw = difference_of(vw, Wq)
            ww = difference_of(ww, hat_times(q, Wq))
            gv, gw = subtract(gv, g), subtract(gw, cross(q, g))
        _set(D[i], vv, vw, upper(ww))
        for a in range(3):
            g6[i, a], g6[i, 3 + a] = gv[a], gw[a]
    for t in range(len(by_tag)):
        for a in range(3):
            for b in range(a):
                by_tag[t, a, b] = by_tag[t, b, a]


@compiled
def _set(
    D: Array,
    vv: tuple[float, float, float, float, float, float],
    vw: tuple[float, float, float, float, float, float, float, float, float],
    ww: tuple[float, float, float, float, float, float],
) -> None:
    n = 0
    for a in range(3):
        for b in range(a, 3):
            D[a, b] = D[b, a] = vv[n]
            D[3 + a, 3 + b] = D[3 + b, 3 + a] = ww[n]
            n += 1
        for b in range(3):
            D[a, 3 + b] = D[3 + b, a] = vw[3 * a + b]


@compiled
def linearise_steps(steps: Steps, T: Array, weight: Array, r2: Array, linear: Linear) -> float:
    """Add odometry to diagonal and pose_gradient, set following; the cost.

    The residual is log(T_prev_cur^-1 T_i^-1 T_i+1). Moving poses i and i + 1 as one rigid body does
    not change it, so its Hessian by pose i is that by i + 1, carried over the lever between them.
    weight, r2 (N - 1,): of each step.
    """
    D, off, g6 = linear.diagonal, linear.following, linear.pose_gradient
    cost = 0.0
    for i in range(len(T) - 1):
        if steps.has[i] == 0:
            off[i, :, :] = 0.0
            continue
        R_i, R_j, R_m = rotation_of(T[i]), rotation_of(T[i + 1]), rotation_of(steps.T[i])
        q = subtract(position_of(T[i + 1]), position_of(T[i]))
        t = transposed_times(R_m, subtract(transposed_times(R_i, q), position_of(steps.T[i])))
        R = product(transpose(R_m), product(transpose(R_i), R_j))
        v, w = logarithm(R, t)
        A, B = inverse_right_jacobian(v, w)
        R_map = transpose(R_j)
        A, B = product(A, R_map), product(B, R_map)
        Q = steps.information[i]
        f = weight[i]
        vv = f * Q[0, 0], f * Q[0, 1], f * Q[0, 2], f * Q[1, 1], f * Q[1, 2], f * Q[2, 2]
        ww = f * Q[3, 3], f * Q[3, 4], f * Q[3, 5], f * Q[4, 4], f * Q[4, 5], f * Q[5, 5]
        vw = (
            f * Q[0, 3],
            f * Q[0, 4],
            f * Q[0, 5],
            f * Q[1, 3],
            f * Q[1, 4],
            f * Q[1, 5],
            f * Q[2, 3],
            f * Q[2, 4],
            f * Q[2, 5],
        )
        s = add(symmetric_times(vv, v), times(vw, w))
        u = add(transposed_times(vw, v), symmetric_times(ww, w))
        square = dot(s, v) + dot(u, w)
        cost += square
        r2[i] = square / f if f > 0.0 else 0.0
        gv = transposed_times(A, s)
        gw = add(transposed_times(B, s), transposed_times(A, u))
        left, right = product(full(vv), A), sum_of(product(full(vv), B), product(vw, A))
        low = sum_of(product(transpose(vw), B), product(full(ww), A))
        At, Bt = transpose(A), transpose(B)
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
    return cost
