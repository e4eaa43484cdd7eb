"""Robust means of what sightings say of each tag's position, poses given."""

import math

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.kernels.motion import position_of, rotation_of
from tagmap.estimation.kernels.small import (
    S,
    V,
    add,
    dot,
    full,
    inverse,
    product,
    subtract,
    symmetric_times,
    times,
    transpose,
    upper,
)
from tagmap.geometry.kernels.compiled import compiled, internal

_CANDIDATES, _VOTERS = 24, 100
_SETTLED = 1e-4


@compiled
def to_map(pose: Index, p_base: Array, information: Array, T: Array, p: Array, info: Array) -> None:
    """p (K, 3), info (K, 6) in map of points p_base (K, 3), information (K, 3, 3) in base."""
    for k in range(len(pose)):
        R = rotation_of(T[pose[k]])
        q = times(R, (p_base[k, 0], p_base[k, 1], p_base[k, 2]))
        q = add(q, position_of(T[pose[k]]))
        J = information[k]
        W = full((J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2]))
        turned = upper(product(R, product(W, transpose(R))))
        for n in range(3):
            p[k, n] = q[n]
        for n in range(6):
            info[k, n] = turned[n]


@internal
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
    start: Index,
    p: Array,
    info: Array,
    d: int,
    least: float,
    rounds: int,
    mean: Array,
    total: Array,
    n: Array,
) -> None:
    """mean (M, 3), total (M, 3, 3) information and n (M,) sum of weights of M tags.

    Tag t has the points start[t]:start[t + 1] of p (K, 3), info (K, 6). Iteratively reweighted
    means     with a Cauchy loss, from where its points agree best. NaN and 0 where they do not
    determine it.
    """
    for t in range(len(start) - 1):
        begin, end = start[t], start[t + 1]
        own_p, own_info = p[begin:end], info[begin:end]
        known, m = _voted(own_p, own_info, d, least)
        good = end > begin
        A = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        weight = 0.0
        for _ in range(rounds if good else 0):
            before = m
            good, m, A, weight = _mean(own_p, own_info, d, least, known, m)
            shift = subtract(m, before)
            if not good or (known and dot(shift, symmetric_times(A, shift)) < _SETTLED):
                break
            known = True
        if not good:
            mean[t, :] = np.nan
            total[t, :, :] = 0.0
            n[t] = 0.0
            continue
        mean[t, 0], mean[t, 1], mean[t, 2] = m
        n[t] = weight
        total[t, 0, 0], total[t, 1, 1], total[t, 2, 2] = A[0], A[3], A[5]
        total[t, 0, 1] = total[t, 1, 0] = A[1]
        total[t, 0, 2] = total[t, 2, 0] = A[2]
        total[t, 1, 2] = total[t, 2, 1] = A[4]


@compiled
def _mean(
    p: Array, info: Array, d: int, least: float, known: bool, about: V
) -> tuple[bool, V, S, float]:
    """One reweighted mean of points p (k, 3), info (k, 6); its information, sum of weights."""
    A0 = A1 = A2 = A3 = A4 = A5 = b0 = b1 = b2 = sum_ = 0.0
    for k in range(len(p)):
        W = info[k, 0], info[k, 1], info[k, 2], info[k, 3], info[k, 4], info[k, 5]
        w = 1.0 / (1.0 + _square(p[k], W, about) / d) if known else 1.0
        y = symmetric_times(W, (p[k, 0], p[k, 1], p[k, 2]))
        A0, A1, A2 = A0 + w * W[0], A1 + w * W[1], A2 + w * W[2]
        A3, A4, A5 = A3 + w * W[3], A4 + w * W[4], A5 + w * W[5]
        b0, b1, b2 = b0 + w * y[0], b1 + w * y[1], b2 + w * y[2]
        sum_ += w
    A = A0, A1, A2, A3, A4, A5
    good, mean = _solved(A, (b0, b1, b2), d, least)
    return good, mean, A, sum_


@compiled
def _square(p: Array, W: S, m: V) -> float:
    offset = p[0] - m[0], p[1] - m[1], p[2] - m[2]
    return dot(offset, symmetric_times(W, offset))


@compiled
def _solved(A: S, b: V, d: int, least: float) -> tuple[bool, V]:
    whole = A[0], A[1], A[2], A[3], A[4], A[5] + (1.0 if d == 2 else 0.0)
    positive, cov = inverse(whole)
    good = positive and well_conditioned(whole, d, least)
    return good, (symmetric_times(cov, b) if good else (0.0, 0.0, 0.0))


@compiled
def _voted(p: Array, info: Array, d: int, least: float) -> tuple[bool, V]:
    """Where points p (k, 3), info (k, 6) agree best: at one of them, or where two rays cross.

    By the sum of Cauchy losses, which a point that is far off from all the others adds to alike
    wherever the vote falls. Some of many points vote and are voted on, spread over all.
    """
    k = len(p)
    best, found, place = math.inf, False, (0.0, 0.0, 0.0)
    stride = max(1, k // _VOTERS)
    for c in range(min(k, _CANDIDATES)):
        i = c * k // min(k, _CANDIDATES)
        good, m = _crossing(p, info, i, i, d, least)
        if not good:
            j = (i + k // 2 + c) % k
            good, m = _crossing(p, info, i, j, d, least)
        if not good:
            continue
        cost = 0.0
        for v in range(0, k, stride):
            W = info[v, 0], info[v, 1], info[v, 2], info[v, 3], info[v, 4], info[v, 5]
            cost += math.log1p(_square(p[v], W, m) / d)
            if cost >= best:
                break
        if cost < best:
            best, found, place = cost, True, m
    return found, place


@compiled
def _crossing(p: Array, info: Array, i: int, j: int, d: int, least: float) -> tuple[bool, V]:
    """The mean of two points, or one."""
    W = info[i, 0], info[i, 1], info[i, 2], info[i, 3], info[i, 4], info[i, 5]
    if i == j:
        return well_conditioned(W, d, least), (p[i, 0], p[i, 1], p[i, 2])
    U = info[j, 0], info[j, 1], info[j, 2], info[j, 3], info[j, 4], info[j, 5]
    both = W[0] + U[0], W[1] + U[1], W[2] + U[2], W[3] + U[3], W[4] + U[4], W[5] + U[5]
    a = symmetric_times(W, (p[i, 0], p[i, 1], p[i, 2]))
    b = symmetric_times(U, (p[j, 0], p[j, 1], p[j, 2]))
    return _solved(both, add(a, b), d, least)
