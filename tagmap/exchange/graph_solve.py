"""Solve a graph: from the start values of its file, or from nothing."""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.errors import DegenerateError
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.points import fit_tags, points_of
from tagmap.estimation.problem import State, lie
from tagmap.estimation.residuals import Residuals
from tagmap.estimation.start import Start, start_at
from tagmap.exchange.graph_growth import PLAIN, ROBUST, WIDE, grown, widened
from tagmap.exchange.graph_problem import Posed
from tagmap.exchange.graph_robust import INLIER_WEIGHT, robust_optimum

HALFWAY = 3.0


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
            if robust:
                optimum = robust_optimum(posed.problem, posed.chain, start)
            else:
                optimum = optimise(posed.problem, start, Options(robust=False))
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
        problem = widened(problem, WIDE)
    T = grown(problem, chain, ROBUST if robust else PLAIN)
    if chain[-1] == 0:
        # Needs no landmarks to hang together.
        state = State(T, fit_tags(points_of(problem), T, problem.n_tags).p, np.zeros(0))
    else:
        start = start_at(problem, chain, T)
        _check_determined(posed, start)
        state = State(start.T, start.p, np.zeros(0))
    if robust:
        state = optimise(widened(posed.problem, HALFWAY), state, Options()).state
    return state


def _check_determined(posed: Posed, start: Start) -> None:
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


def _as_held(posed: Posed, state: State) -> State:
    """Moved as a whole so that the held pose is where the file has it, else at the origin."""
    group, T_held = lie(posed.problem.kind), np.eye(posed.problem.tag_dof + 1)
    if posed.given is not None:
        T_held = posed.given.T[posed.held]
    T_new_old = T_held @ group.inverse(state.T[posed.held])
    return replace(state, T=T_new_old @ state.T, p=group.act(T_new_old, state.p))


def _rejected(optimum: Optimum) -> int:
    return sum(int((w < INLIER_WEIGHT).sum()) for w in optimum.weights.sightings)
