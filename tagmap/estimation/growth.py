"""A first trajectory and tag map of one odometry chain, grown window by window.

A batch start from dead reckoning is trapped where odometry has turned by radians over an hour.
Growing is not: each window of keyframes starts where the last one ended, is optimised against the
tags known so far, and is then condensed into a Gaussian on its last pose and the tags
(marginalisation: Dellaert & Kaess, "Factor Graphs for Robot Perception", 2017, 5.3).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from tagmap.conventions import Array, Index
from tagmap.estimation.linear import Factorisation, NormalEquations, dense
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.points import Points, fit_tags
from tagmap.estimation.problem import Prior, Problem, State
from tagmap.estimation.restrict import restrict

WINDOW = 60
FIRST_SIGMA = 1e-4
LEAST_SIGHTINGS = 3.0
LEAST_INFORMATION = 1e-9
WINDOW_OPTIONS = Options(max_iterations=30, tolerance=1e-4, mu_step=4.0, max_regroupings=2)


@dataclass(frozen=True, slots=True)
class _Known:
    """Tags of the growing map: their numbers, and how many sightings carry each."""

    prior: Prior
    tags: Index
    support: Array


def grow(problem: Problem, points: Points, poses: Index) -> Array:
    """Poses (n, D, D) of the chain `poses` in the frame of its first one.

    `problem` is without scales and surveys; `points` are those of all its sightings.
    """
    size = problem.tag_dof + 1
    T = np.empty((len(poses), size, size))
    T[0] = np.eye(size)
    if len(poses) == 1:
        return T
    steps = _steps(problem, poses)
    known = _nothing_known(problem, T[0])
    start = 0
    while True:
        stop = min(start + WINDOW, len(poses))
        window = np.arange(start, stop)
        for i in window[1:]:
            T[i] = T[i - 1] @ steps[i - 1]
        T[window], known = _advance(problem, points, poses[window], T[window], known)
        if stop == len(poses):
            return T
        start = stop - 1


def _steps(problem: Problem, poses: Index) -> Array:
    """Odometry steps along the chain, (n - 1, D, D)."""
    start, stop = np.searchsorted(problem.odometry.first, [poses[0], poses[-1]])
    return problem.odometry.T[start:stop]


def _nothing_known(problem: Problem, T: Array) -> _Known:
    """But that the next pose to start from is T (D, D)."""
    dof = problem.pose_dof
    none = np.zeros(0, dtype=np.int64)
    sure = np.eye(dof) / FIRST_SIGMA**2
    prior = Prior(none, T, np.zeros((0, problem.tag_dof)), sure)
    return _Known(prior, none, np.zeros(0))


def _advance(
    problem: Problem, points: Points, poses: Index, T: Array, known: _Known
) -> tuple[Array, _Known]:
    """Optimise one window whose first pose the prior holds; return its poses and the new prior."""
    new = _new_tags(points, poses, T, known.tags, problem.n_tags)
    tags = np.union1d(known.tags, new.tags)
    p = np.empty((len(tags), problem.tag_dof))
    p[np.searchsorted(tags, new.tags)] = new.p
    at = np.searchsorted(tags, known.tags)
    p[at] = known.prior.p
    window = replace(restrict(problem, poses, tags), prior=replace(known.prior, tag=at))
    optimum = optimise(window, State(T, p, np.ones(0)), WINDOW_OPTIONS)
    support = _support(window, optimum)
    support[at] += known.support
    return optimum.state.T, _condense(window, optimum, tags, support)


@dataclass(frozen=True, slots=True)
class _NewTags:
    tags: Index
    p: Array


def _new_tags(points: Points, poses: Index, T: Array, known: Index, n_tags: int) -> _NewTags:
    """Start positions of the tags that the window sees and nobody knew."""
    seen = points.of_poses(poses[0], poses[-1])
    unknown = np.flatnonzero(~np.isin(seen.tag, known))
    if not len(unknown):
        return _NewTags(unknown, np.zeros((0, T.shape[-1] - 1)))
    fit = fit_tags(seen.take(unknown), T, n_tags)
    tags = np.flatnonzero(fit.determined)
    return _NewTags(tags, fit.p[tags])


def _support(window: Problem, optimum: Optimum) -> Array:
    """Sum of robust weights per tag, (M,)."""
    support = np.zeros(window.n_tags)
    for block, w in zip(window.sightings, optimum.weights.sightings, strict=True):
        np.add.at(support, block.tag, w)
    return support


def _condense(window: Problem, optimum: Optimum, tags: Index, support: Array) -> _Known:
    """Marginalise all but the last pose, and the tags that too few sightings carry.

    Where rounding leaves nothing positive definite of it, the window is forgotten.
    """
    state = optimum.state
    lasting = np.flatnonzero(support >= LEAST_SIGHTINGS)
    try:
        whole = _last_pose_and_tags(optimum.equations, window.pose_dof)
        information = _marginal(whole, _columns(lasting, window))
    except linalg.LinAlgError:
        return _nothing_known(window, state.T[-1])
    prior = Prior(lasting, state.T[-1], state.p[lasting], information)
    return _Known(prior, tags[lasting], support[lasting])


def _marginal(information: Array, kept: Index) -> Array:
    """Schur complement on the columns `kept`. Raises LinAlgError if not positive definite."""
    gone = np.setdiff1d(np.arange(len(information)), kept)
    reduced = information[np.ix_(kept, kept)]
    if len(gone):
        block = information[np.ix_(gone, gone)] + LEAST_INFORMATION * np.eye(len(gone))
        cross = information[np.ix_(gone, kept)]
        reduced = reduced - cross.T @ linalg.cho_solve(linalg.cho_factor(block), cross)
    linalg.cholesky(reduced)
    symmetric: Array = 0.5 * (reduced + reduced.T)
    return symmetric


def _columns(tags: Index, window: Problem) -> Index:
    """Columns of the last pose and of `tags` where that pose comes before all tags."""
    dof, d = window.pose_dof, window.tag_dof
    return np.concatenate([np.arange(dof), (dof + tags[:, None] * d + np.arange(d)).ravel()])


def _last_pose_and_tags(equations: NormalEquations, dof: int) -> Array:
    """Schur complement on (last pose, border): the last pose joins the border."""
    coupling = dense(equations.coupling)
    last = coupling[-dof:]
    border = np.block([[equations.diagonal[-1], last], [last.T, equations.border]])
    rows = len(coupling) - dof
    if not rows:
        return border
    link = np.zeros((rows, dof))
    link[-dof:] = equations.next[-1].T
    rest = NormalEquations(
        equations.diagonal[:-1],
        equations.next[:-1],
        np.hstack([link, coupling[:rows]]),
        border,
        equations.gradient_pose[:-1],
        np.zeros(len(border)),
    )
    return Factorisation(rest).schur
