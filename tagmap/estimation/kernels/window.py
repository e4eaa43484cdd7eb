"""A window of poses localised on tags that are known more or less, and the tags brought up to date.

A sighting then counts with the uncertainty of its tag: where the tag's position has information I
of its own, W and g become W - W (W + I)^-1 W and g - W (W + I)^-1 g, which is the minimum over the
tag's position of both terms together.
"""

import math
from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.kernels.chain import factor, lever, solve
from tagmap.estimation.kernels.layout import Linear, Sighted, Steps
from tagmap.estimation.kernels.motion import move_all, position_of, rotation_of, rotation_vector
from tagmap.estimation.kernels.plane import lift
from tagmap.estimation.kernels.sightings import (
    KEEP,
    by_point,
    condensed,
    linearise_sightings,
    nothing,
    observe,
    set_pose,
    truncated,
    with_view,
)
from tagmap.estimation.kernels.small import (
    S,
    V,
    add,
    dot,
    full,
    inverse,
    product,
    scaled,
    subtract,
    symmetric_times,
    times,
    transpose,
    transposed_times,
    upper,
)
from tagmap.estimation.kernels.steps import linearise_steps
from tagmap.estimation.robust import BLUNT, BLUNTEST, MOST, SHARPEST
from tagmap.geometry.kernels.compiled import compiled

Six = tuple[float, float, float, float, float, float]

_MOST_STEPS = 30
_SHARPEN_BELOW = 0.1
_CONVERGED = 1e-4


class Window(NamedTuple):
    """n poses and K sightings, poses numbered from 0, and room to work on them.

    hold (6, 6): information on the first pose about T_hold (4, 4), along the axes of the map.
    pins (6,): see tagmap.estimation.packing. ones (max(K, n),); r2, weight, next_weight (K,);
    step_r2, step_weight, next_step_weight (n - 1,); L, D (n, 6, 6); u (n, 6);
    before (n, 4, 4); work (6, 6). own_L, own_D: L and D, or (n, 3, 3) where nothing leaves the
    plane.
    """

    sighted: Sighted
    steps: Steps
    linear: Linear
    hold: Array
    T_hold: Array
    pins: Array
    ones: Array
    r2: Array
    weight: Array
    next_weight: Array
    step_r2: Array
    step_weight: Array
    next_step_weight: Array
    step_bound: float
    least_step: float
    L: Array
    D: Array
    own_L: Array
    own_D: Array
    u: Array
    before: Array
    work: Array


NOWHERE = (0.0, 0.0, 0.0, 0.0)


@compiled
def reckon(steps: Steps, T: Array) -> None:
    """T (n, 4, 4) from the first one on, by odometry alone."""
    for i in range(len(T) - 1):
        step = steps.T[steps.row[i]]
        for a in range(4):
            for b in range(4):
                T[i + 1, a, b] = 0.0
                for c in range(4):
                    T[i + 1, a, b] += T[i, a, c] * step[c, b]


@compiled
def localise(window: Window, T: Array, p: Array, information: Array, mu_step: float) -> bool:
    """Move T (n, 4, 4) to where its sightings of known tags fit best; `weight` says which do.

    p (M, 3), NaN where not known, with information (M, 3, 3). Weights sharpen as in
    tagmap.estimation.optimise. False where nothing determines the window.
    """
    good = _localise(window, T, p, information, mu_step)
    if window.own_L.shape[1] == 3:
        lift(window.own_L, 0.0, window.L)
        lift(window.own_D, 1.0, window.D)
    return good


@compiled
def _localise(window: Window, T: Array, p: Array, information: Array, mu_step: float) -> bool:
    linear, weight, u = window.linear, window.weight, window.u
    n, k = len(T), len(window.r2)
    window.step_weight[:] = 1.0
    _linearise(window, T, p, information, KEEP, window.ones[:k], weight)
    mu = _first_mu(window)
    _, cost = _linearise(window, T, p, information, mu, window.ones[:k], weight)
    window.step_weight[:] = window.next_step_weight
    damping = 1e-9
    for _ in range(_MOST_STEPS):
        if not factor(linear, damping, window.own_L, window.own_D, window.work):
            return False
        for i in range(n):
            for a in range(6):
                u[i, a] = -linear.pose_gradient[i, a]
        solve(window.own_L, window.own_D, u)
        predicted = 0.0
        for i in range(n):
            for a in range(6):
                predicted -= u[i, a] * linear.pose_gradient[i, a]
        if mu >= SHARPEST and predicted <= _CONVERGED * max(cost, 1.0):
            return True
        if predicted <= _SHARPEN_BELOW * cost:
            mu = SHARPEST if _decided(window) else min(mu * mu_step, SHARPEST)
        window.before[:] = T
        move_all(window.before, u, T)
        asked, next_cost = _linearise(window, T, p, information, mu, weight, window.next_weight)
        if asked <= cost:
            cost = next_cost
            weight[:] = window.next_weight
            window.step_weight[:] = window.next_step_weight
            damping = max(0.1 * damping, 1e-12)
            continue
        T[:] = window.before
        damping = max(10.0 * damping, 1e-6)
        if damping > 1e8:
            return True
        _, cost = _linearise(window, T, p, information, KEEP, weight, window.next_weight)
    return True


@compiled
def _first_mu(window: Window) -> float:
    """As tagmap.estimation.robust.first_mu has it, of sightings whose tag is known."""
    sighted, r2 = window.sighted, window.r2
    ratio = np.empty(len(r2))
    n = 0
    for k in range(len(r2)):
        if r2[k] < math.inf:
            ratio[n] = r2[k] / sighted.c2[sighted.block[sighted.how[k]]]
            n += 1
    if n == 0:
        return SHARPEST
    worst = float(np.sort(ratio[:n])[math.ceil(MOST * (n - 1))])
    return min(max(1.0 / max(2.0 * worst - 1.0, 1e-9), BLUNTEST), BLUNT)


@compiled
def _decided(window: Window) -> bool:
    """Whether every factor is in or out, as sharper weights would have it too."""
    decided = True
    for w in window.weight:
        decided &= w == 0.0 or w == 1.0
    for w in window.step_weight:
        decided &= w <= window.least_step or w == 1.0
    return decided


@compiled
def _linearise(
    window: Window,
    T: Array,
    p: Array,
    information: Array,
    mu: float,
    weight: Array,
    next_weight: Array,
) -> tuple[float, float]:
    """The poses' normal equations, each sighting's tag minimised out; costs at both weights."""
    cost = asked = 0.0
    whiten = window.sighted.whiten
    sighted, linear, r2 = window.sighted, window.linear, window.r2
    for i in range(len(T)):
        R_base, t_base = transpose(rotation_of(T[i])), position_of(T[i])
        sums = nothing()
        for k in range(linear.first[i], linear.first[i + 1]):
            t, how = sighted.tag[k], sighted.how[k]
            mount = sighted.T_cam_base[sighted.mount[how]]
            R = product(rotation_of(mount), R_base)
            q = subtract((p[t, 0], p[t, 1], p[t, 2]), t_base)
            cam, block = add(times(R, q), position_of(mount)), sighted.block[how]
            square, r, rows = observe(
                sighted.form[block], sighted.rigs[block], cam, NOWHERE, sighted.z, k, whiten, how
            )
            x, y, z = by_point(whiten, how, rows, R)
            W, g = condensed(1.0, 1.0, x, y, z, r)
            if square < math.inf:
                W, g, square = _discounted(W, g, square, information[t])
                asked += weight[k] * square
            elif weight[k] > 0.0 and p[t, 0] == p[t, 0]:
                asked = math.inf
            w = weight[k]
            if mu >= 0.0:
                w = truncated(square, sighted.c2[block], math.inf if mu >= SHARPEST else mu)
            r2[k], next_weight[k] = square, 0.0
            if w > 0.0 and square < math.inf:
                cost += w * square
                next_weight[k] = w
                W = w * W[0], w * W[1], w * W[2], w * W[3], w * W[4], w * W[5]
                sums = with_view(sums, W, q, scaled(w, g))
        set_pose(linear.diagonal[i], linear.pose_gradient[i], sums)
    asked_steps, cost_steps = linearise_steps(
        window.steps,
        math.inf if mu >= SHARPEST else mu,
        window.step_bound,
        window.least_step,
        window.step_weight,
        window.next_step_weight,
        window.step_r2,
        bool(np.bool_(True)),
        linear,
    )
    rest = _add_hold(window, T)
    for i in range(len(T)):
        for a in range(6):
            linear.diagonal[i, a, a] += window.pins[a]
    return asked + asked_steps + rest, cost + cost_steps + rest


@compiled
def _discounted(W: S, g: V, square: float, known: Array) -> tuple[S, V, float]:
    """W, g and r2 of a sighting whose tag may move."""
    total = (
        W[0] + known[0, 0],
        W[1] + known[0, 1],
        W[2] + known[0, 2],
        W[3] + known[1, 1],
        W[4] + known[1, 2],
        W[5] + known[2, 2],
    )
    good, free = inverse(total)
    if not good:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    y = symmetric_times(free, g)
    loss = product(full(W), product(full(free), full(W)))
    less = upper(loss)
    return (
        (
            W[0] - less[0],
            W[1] - less[1],
            W[2] - less[2],
            W[3] - less[3],
            W[4] - less[4],
            W[5] - less[5],
        ),
        subtract(g, symmetric_times(W, y)),
        max(square - dot(g, y), 0.0),
    )


@compiled
def bend(L: Array, T: Array, T_last: Array, information: Array, bound: float) -> bool:
    """T (n, 4, 4) but for the last one, which has come from T_last, follow it; False: no need.

    That is where the last step, of information (6, 6), has come to miss by less than bound chi2.
    What they saw holds them back: L (n, 6, 6) is that of their factor.
    """
    n = len(T)
    if n < 2 or _square(information, _way(T_last, T[n - 1]), T[n - 1]) < bound:
        return False
    step = np.zeros((n, 6))
    for a, value in enumerate(_way(T_last, T[n - 1])):
        step[n - 1, a] = value
    for i in range(n - 2, -1, -1):
        for a in range(6):
            for b in range(6):
                step[i, a] -= L[i + 1, b, a] * step[i + 1, b]
    move_all(T[: n - 1].copy(), step, T[: n - 1])
    return True


@compiled
def _square(information: Array, way: Six, T: Array) -> float:
    """chi2 of a way along the axes of the map by an information in axes of T."""
    R = rotation_of(T)
    v = transposed_times(R, (way[0], way[1], way[2]))
    w = transposed_times(R, (way[3], way[4], way[5]))
    e = v[0], v[1], v[2], w[0], w[1], w[2]
    square = 0.0
    for a in range(6):
        for b in range(6):
            square += information[a, b] * e[a] * e[b]
    return square


@compiled
def _way(T: Array, T_new: Array) -> Six:
    """From one pose to another, (v, omega) along the axes of the map."""
    v = subtract(position_of(T_new), position_of(T))
    w = rotation_vector(product(rotation_of(T_new), transpose(rotation_of(T))))
    return v[0], v[1], v[2], w[0], w[1], w[2]


@compiled
def _add_hold(window: Window, T: Array) -> float:
    """What is known of the first pose beforehand."""
    linear, hold = window.linear, window.hold
    error = _way(window.T_hold, T[0])
    cost = 0.0
    for a in range(6):
        pull = 0.0
        for b in range(6):
            pull += hold[a, b] * error[b]
            linear.diagonal[0, a, b] += hold[a, b]
        linear.pose_gradient[0, a] += pull
        cost += pull * error[a]
    return cost


@compiled
def refit_tags(window: Window, p: Array, information: Array, support: Array) -> None:
    """Tags that count in the window move to where it sees them too; their information grows.

    By as much as is left when the poses are not taken as known. support (M,): sum of weights of all
    sightings so far.
    """
    sighted, linear = window.sighted, window.linear
    linear.tag_diagonal[:] = 0.0
    linear.tag_gradient[:] = 0.0
    none = linear.calibration_gradient
    linearise_sightings(
        sighted,
        none,
        KEEP,
        window.weight,
        window.next_weight,
        window.r2,
        bool(np.bool_(True)),
        linear,
    )
    for k in range(len(window.r2)):
        support[sighted.tag[k]] += window.next_weight[k]
    for t in range(len(p)):
        own = linear.tag_diagonal[t]
        if not own[0, 0] + own[1, 1] + own[2, 2] > 0.0:
            continue
        _limit_by_poses(window, t, own)
        known = information[t]
        for a in range(3):
            for b in range(3):
                known[a, b] += own[a, b]
        good, cov = inverse(
            (known[0, 0], known[0, 1], known[0, 2], known[1, 1], known[1, 2], known[2, 2])
        )
        if good:
            g = linear.tag_gradient[t]
            step = symmetric_times(cov, (g[0], g[1], g[2]))
            for a in range(3):
                p[t, a] -= step[a]


@compiled
def _limit_by_poses(window: Window, tag: int, own: Array) -> None:
    """Information own (3, 3) of one tag, less what the best known of its poses is uncertain by."""
    linear, D = window.linear, window.D
    least = math.inf
    cov = np.empty((3, 3))
    trial = np.empty((3, 3))
    G = np.empty((3, 6))
    for i in range(len(linear.first) - 1):
        for k in range(linear.first[i], linear.first[i + 1]):
            if linear.tag[k] != tag or not window.next_weight[k] > 0.0:
                continue
            x, y, z = lever(linear.p, tag, linear.T, i)
            G[:, :] = 0.0
            G[0, 0] = G[1, 1] = G[2, 2] = 1.0
            G[0, 4], G[0, 5], G[1, 3] = z, -y, -z
            G[1, 5], G[2, 3], G[2, 4] = x, y, -x
            for a in range(3):
                for b in range(3):
                    sum_ = 0.0
                    for c in range(6):
                        for e in range(6):
                            sum_ += G[a, c] * D[i, c, e] * G[b, e]
                    trial[a, b] = sum_
            if trial[0, 0] + trial[1, 1] + trial[2, 2] < least:
                least = trial[0, 0] + trial[1, 1] + trial[2, 2]
                cov[:, :] = trial
    good, known = inverse((cov[0, 0], cov[0, 1], cov[0, 2], cov[1, 1], cov[1, 2], cov[2, 2]))
    if not (good and least < math.inf):
        return
    # own (own + known)^-1 known: both uncertainties add up
    total = (
        own[0, 0] + known[0],
        own[0, 1] + known[1],
        own[0, 2] + known[2],
        own[1, 1] + known[3],
        own[1, 2] + known[4],
        own[2, 2] + known[5],
    )
    good, free = inverse(total)
    if not good:
        return
    W = full((own[0, 0], own[0, 1], own[0, 2], own[1, 1], own[1, 2], own[2, 2]))
    less = product(W, product(full(free), W))
    for a in range(3):
        for b in range(3):
            own[a, b] -= 0.5 * (less[3 * a + b] + less[3 * b + a])
