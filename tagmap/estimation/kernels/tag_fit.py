"""Robust means of what sightings say of each tag's position, poses given."""

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.kernels.motion import position_of, rotation_of
from tagmap.estimation.kernels.small import (
    S,
    add,
    full,
    inverse,
    product,
    symmetric_times,
    times,
    transpose,
    upper,
)
from tagmap.geometry.kernels.compiled import compiled


@compiled
def to_map(pose: Index, p_base: Array, information: Array, T: Array, p: Array, I: Array) -> None:
    """p (K, 3) and I (K, 6) in map of points p_base (K, 3) with information (K, 3, 3) in base."""
    for k in range(len(pose)):
        R = rotation_of(T[pose[k]])
        q = times(R, (p_base[k, 0], p_base[k, 1], p_base[k, 2]))
        q = add(q, position_of(T[pose[k]]))
        J = information[k]
        W = full((J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2]))
        W = upper(product(R, product(W, transpose(R))))
        for n in range(3):
            p[k, n] = q[n]
        for n in range(6):
            I[k, n] = W[n]


@compiled
def well_conditioned(W: S, d: int, least: float) -> bool:
    """Whether every one of the first d directions is known at least `least` as well as the best.

    By information: `least` is the square of a ratio of standard deviations.
    """
    if d == 3:
        trace = W[0] + W[3] + W[5]
        determinant = (
            W[0] * (W[3] * W[5] - W[4] * W[4])
            - W[1] * (W[1] * W[5] - W[4] * W[2])
            + W[2] * (W[1] * W[4] - W[3] * W[2])
        )
    else:
        trace = W[0] + W[3]
        determinant = (W[0] * W[3] - W[1] * W[1]) * trace
    if not trace > 0.0:
        return False
    # The determinant is no more than the least eigenvalue times the square of the trace.
    if determinant > least * trace * trace * trace:
        return True
    A = np.array([[W[0], W[1], W[2]], [W[1], W[3], W[4]], [W[2], W[4], W[5]]])
    eigenvalues = np.linalg.eigvalsh(A[:d, :d])
    return bool(eigenvalues[0] > least * eigenvalues[-1])


@compiled
def fit(
    start: Index, p: Array, I: Array, d: int, least: float, rounds: int, mean: Array, total: Array,
    n: Array,
) -> None:
    """mean (M, 3), total (M, 3, 3) information and n (M,) sum of weights of M tags.

    Tag t has the points start[t]:start[t + 1] of p (K, 3), I (K, 6). Iteratively reweighted means
    with a Cauchy loss, from the median of those points that fix all directions. NaN and 0 where the
    points of a tag do not determine it.
    """
    for t in range(len(start) - 1):
        begin, end = start[t], start[t + 1]
        w = np.ones(end - begin)
        whole = np.zeros(end - begin, dtype=np.bool_)
        for k in range(begin, end):
            W = I[k, 0], I[k, 1], I[k, 2], I[k, 3], I[k, 4], I[k, 5]
            whole[k - begin] = well_conditioned(W, d, least)
        known = whole.any()
        m0 = m1 = m2 = 0.0
        if known:
            own = p[begin:end][whole]
            m0, m1, m2 = np.median(own[:, 0]), np.median(own[:, 1]), np.median(own[:, 2])
        good = True
        for _ in range(rounds):
            A = np.zeros(6)
            b = np.zeros(3)
            for k in range(begin, end):
                W = I[k, 0], I[k, 1], I[k, 2], I[k, 3], I[k, 4], I[k, 5]
                w[k - begin] = 1.0
                if known:
                    offset = p[k, 0] - m0, p[k, 1] - m1, p[k, 2] - m2
                    y = symmetric_times(W, offset)
                    r2 = offset[0] * y[0] + offset[1] * y[1] + offset[2] * y[2]
                    w[k - begin] = 1.0 / (1.0 + r2 / d)
                y = symmetric_times(W, (p[k, 0], p[k, 1], p[k, 2]))
                for i in range(6):
                    A[i] += w[k - begin] * W[i]
                for i in range(3):
                    b[i] += w[k - begin] * y[i]
            sum_ = A[0], A[1], A[2], A[3], A[4], A[5] + (1.0 if d == 2 else 0.0)
            good = well_conditioned(sum_, d, least)
            positive, cov = inverse(sum_)
            if not (good and positive):
                good = False
                break
            m0, m1, m2 = symmetric_times(cov, (b[0], b[1], b[2]))
            known = True
        if not good or begin == end:
            mean[t, :] = np.nan
            total[t, :, :] = 0.0
            n[t] = 0.0
            continue
        mean[t, 0], mean[t, 1], mean[t, 2] = m0, m1, m2
        n[t] = w.sum()
        total[t, 0, 0], total[t, 1, 1], total[t, 2, 2] = A[0], A[3], A[5]
        total[t, 0, 1] = total[t, 1, 0] = A[1]
        total[t, 0, 2] = total[t, 2, 0] = A[2]
        total[t, 1, 2] = total[t, 2, 1] = A[4]
