"""The robust optimum of a graph, and away from it: what is trapped is moved, if that is better."""

import numpy as np

from tagmap.conventions import Index, Mask
from tagmap.estimation import robust
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.points import Points, points_of
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.revote import Votes, revoted
from tagmap.estimation.start import Start
from tagmap.estimation.stretches import relaid

INLIER_WEIGHT = 0.5
MOST_ROUNDS = 4
WORTH = 1e-6


def robust_optimum(problem: Problem, chain: Index, state: State) -> Optimum:
    """The lowest truncated cost that is found from `state`; `chain` (N,): chain of each pose."""
    best = optimise(problem, state, Options())
    if not (np.isfinite(best.state.T).all() and np.isfinite(best.state.p).all()):
        return best
    points = points_of(problem)
    votes, tried = Votes.of(problem, points), np.zeros(problem.n_poses, dtype=bool)
    for _ in range(MOST_ROUNDS):
        start = _everything(best.state)
        voted = revoted(votes, start)
        if voted is not None:
            votes, start = voted[0], _everything(State(start.T, voted[1].p, np.zeros(0)))
        laid = relaid(problem, points, chain, start, _accepted(points, best), tried)
        if voted is None and laid is None:
            break
        moved = laid or start
        other = optimise(problem, State(moved.T, moved.p, np.zeros(0)), Options())
        if not truncated_cost(problem, other) < (1.0 - WORTH) * truncated_cost(problem, best):
            break
        best = other
    return best


def truncated_cost(problem: Problem, optimum: Optimum) -> float:
    """Sum of min(r2, bound) of all edges: what robust optima can be compared by."""
    residuals = optimum.residuals
    cost = np.minimum(residuals.odometry, robust.step_bound(problem.pose_dof)).sum()
    for block, r2 in zip(problem.sightings, residuals.sightings, strict=True):
        cost += np.minimum(r2, robust.chi2_bound(block.z.shape[1])).sum()
    return float(cost)


def _everything(state: State) -> Start:
    placed, mapped = np.ones(len(state.T), dtype=bool), np.ones(len(state.p), dtype=bool)
    return Start(state.T, state.p, placed, mapped, anchored=False)


def _accepted(points: Points, optimum: Optimum) -> Mask:
    weights = np.concatenate([*optimum.weights.sightings, np.zeros(0)])
    return np.asarray(weights[points.row] >= INLIER_WEIGHT)
