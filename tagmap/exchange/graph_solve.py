"""Solve a graph: from the start values of its file, or from nothing."""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.errors import DegenerateError
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.points import Points, fit_tags, points_of
from tagmap.estimation.problem import Problem, State, lie
from tagmap.estimation.residuals import Residuals
from tagmap.estimation.restrict import restrict
from tagmap.estimation.start import start_at, start_from_nothing
from tagmap.exchange.graph_problem import Posed

FIRST_POSES = 50
GROWTH = 1.25
GROWING = Options(robust=False, tolerance=1e-3, max_iterations=20)


@dataclass(frozen=True, slots=True)
class SolvedGraph:
    """chi2: of all edges, whatever their weights."""

    state: State
    chi2_initial: float
    chi2_final: float
    iterations: int
    converged: bool
    rejected: int


def solve_posed(posed: Posed, from_file: bool, robust: bool) -> SolvedGraph:
    """DegenerateError where the edges do not determine the graph, or its numbers are too large."""
    try:
        with np.errstate(all="ignore"):
            start = posed.given if from_file and posed.given else from_nothing(posed, robust)
            still = optimise(posed.problem, start, Options(robust=False, max_iterations=0))
            optimum = optimise(posed.problem, start, Options(robust=robust))
    except np.linalg.LinAlgError as error:
        raise DegenerateError(f"the graph cannot be solved: {error}") from None
    initial, final = chi2(still.residuals), chi2(optimum.residuals)
    if not (np.isfinite(initial) and np.isfinite(final)):
        raise DegenerateError(
            f"chi2 is {initial:g} at the start and {final:g} at the end, expected finite numbers"
        )
    state = _as_held(posed, optimum.state)
    return SolvedGraph(
        state, initial, final, optimum.iterations, optimum.converged, _rejected(optimum)
    )


def chi2(residuals: Residuals) -> float:
    """Sum of squared whitened errors over all edges."""
    return float(sum(r2.sum() for r2 in residuals.sightings) + residuals.odometry.sum())


def from_nothing(posed: Posed, robust: bool) -> State:
    """Start values from the edges alone; DegenerateError names a pose they do not determine."""
    problem, chain = posed.problem, posed.chain
    if robust:
        start = start_from_nothing(problem, chain)
    else:
        T = _grown(problem, chain)
        if chain[-1] == 0:
            # Needs no landmarks to hang together.
            p = fit_tags(points_of(problem), T, problem.n_tags).p
            return State(T, p, np.zeros(0))
        start = start_at(problem, chain, T)
    for what, ids, there in (
        ("pose", posed.poses, start.placed),
        ("landmark", posed.tags, start.mapped),
    ):
        lost = ids[~there]
        if len(lost):
            raise DegenerateError(
                f"{what} {lost[0]} is not determined, {len(lost)} in all; "
                "expected chains that share enough landmarks"
            )
    return State(start.T, start.p, np.zeros(0))


def _grown(problem: Problem, chain: Index) -> Array:
    """(N, D, D): every chain in the frame of its first pose, or as it is where it has but one."""
    T = np.tile(np.eye(problem.tag_dof + 1), (problem.n_poses, 1, 1))
    points = points_of(problem)
    for poses in np.split(np.arange(len(chain)), np.flatnonzero(np.diff(chain)) + 1):
        part = restrict(problem, poses, np.arange(problem.n_tags))
        T[poses] = _grown_chain(part, points.of_poses(poses[0], poses[-1]))
    return T


def _grown_chain(problem: Problem, points: Points) -> Array:
    """Everything up to some pose at once, then up to a quarter more, until the chain is whole.

    Every edge is believed: what would be an outlier to a short piece may be its loop that closes.
    """
    n, T = problem.n_poses, np.tile(np.eye(problem.tag_dof + 1), (problem.n_poses, 1, 1))
    p = np.full((problem.n_tags, problem.tag_dof), np.nan)
    done = 1
    while done < n:
        stop = min(max(done + FIRST_POSES, int(GROWTH * done)), n)
        for i in range(done, stop):
            T[i] = T[i - 1] @ problem.odometry.T[i - 1]
        seen = points.of_poses(0, stop - 1)
        new = seen.take(np.flatnonzero(np.isnan(p[seen.tag, 0])))
        fit = fit_tags(new, T, problem.n_tags)
        p[fit.determined] = fit.p[fit.determined]
        known = np.flatnonzero(np.isfinite(p[:, 0]))
        part = restrict(problem, np.arange(stop), known)
        state = optimise(part, State(T[:stop], p[known], np.zeros(0)), GROWING).state
        T[:stop], p[known] = state.T, state.p
        done = stop
    return T


def _as_held(posed: Posed, state: State) -> State:
    """Moved as a whole so that the held pose is where the file has it, else at the origin."""
    group, T_held = lie(posed.problem.kind), np.eye(posed.problem.tag_dof + 1)
    if posed.given is not None:
        T_held = posed.given.T[posed.held]
    T_new_old = T_held @ group.inverse(state.T[posed.held])
    return replace(state, T=T_new_old @ state.T, p=group.act(T_new_old, state.p))


def _rejected(optimum: Optimum) -> int:
    return sum(int((w < 0.5).sum()) for w in optimum.weights.sightings)
