"""A large site in parts that share tags, each worked on by itself: threads, processes, a cluster.

This is the one Gauss-Newton method of tagmap.estimation.optimise, cut at the tags: every part
eliminates its own poses and hands over what they say of the tags; the tags are solved for; every
part then moves its poses along. The parts overlap in tags, never in poses, so the result is that
of the single solve, to rounding.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.condense import condensed_at, factored
from tagmap.estimation.condensed import Condensed, merged
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.kernels import chain
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.reduced import Reduced
from tagmap.estimation.residuals import Weights
from tagmap.estimation.restrict import restrict, without_surveys
from tagmap.estimation.system import System, Values

TOLERANCE = 1e-10
MOST_ITERATIONS = 50
MOST_HALVINGS = 12


@dataclass(frozen=True, slots=True)
class Joined:
    """The optimum of all parts together, at the weights that were given."""

    state: State
    cost: float
    iterations: int
    converged: bool


@dataclass(frozen=True, slots=True)
class _Part:
    """A submap, without surveys, and the weights of its sightings."""

    problem: Problem
    weights: Weights


@dataclass(frozen=True, slots=True)
class _Move:
    """A part's values, and by how much of which step of tags and calibration to leave them."""

    values: Values
    tags: Array
    calibration: Array
    share: float


def solve_in_parts(
    problem: Problem,
    start: State,
    parts: Sequence[Index],
    executor: Executor,
    weights: Weights | None = None,
) -> Joined:
    """Least squares at fixed weights (all 1 by default), each part by a task of `executor`.

    parts: numbers of poses, every pose in one of them, no odometry chain in two. Raises ValueError
    if not so, LinAlgError where a part does not determine its poses.
    """
    _check(problem, parts)
    weights = weights or Weights.ones(problem)
    submaps = [_submap(problem, poses, weights) for poses in parts]
    tags_only = restrict(problem, np.zeros(0, dtype=np.int64), np.arange(problem.n_tags))
    whole = System(problem).values(start)
    moves = [_stay(Values(whole.T[poses], whole.p, whole.calibration)) for poses in parts]
    said = list(executor.map(_advance, submaps, moves))
    cost = np.inf
    for iteration in range(1, MOST_ITERATIONS + 1):
        step, now, converged = _step(tags_only, said, weights)
        if converged:
            return Joined(_gathered(problem, parts, said), now, iteration, True)
        for halving in range(MOST_HALVINGS):
            moves = [_Move(one.values, *step, 0.5**halving) for one in said]
            trial = list(executor.map(_advance, submaps, moves))
            cost = _cost(tags_only, trial, weights)
            if cost <= now:
                break
        else:
            return Joined(_gathered(problem, parts, said), now, iteration, False)
        said = trial
    return Joined(_gathered(problem, parts, said), cost, MOST_ITERATIONS, False)


@dataclass(frozen=True, slots=True)
class _Said:
    """A part's values, its cost there, and what it says of tags and calibration."""

    values: Values
    cost: float
    condensed: Condensed


def _advance(part: _Part, move: _Move) -> _Said:
    """Poses follow the tags; then the part is linearised where it has come to."""
    system = System(part.problem)
    belief, values = system.belief(part.weights), move.values
    if move.share > 0.0:
        point = system.at(values, belief)
        L, D = factored(point.linear)
        poses, along = -point.linear.pose_gradient, np.zeros_like(point.linear.pose_gradient)
        chain.solve(L, D, poses)
        chain.poses_of(point.linear, L, D, move.tags, move.calibration, along)
        s = move.share
        values = system.moved(values, s * (poses - along), s * move.tags, s * move.calibration)
    point = system.at(values, belief)
    prior = float((point.squares.calibration).sum())
    return _Said(values, point.cost - prior, condensed_at(part.problem, point, part.weights))


def _step(
    tags_only: Problem, said: list[_Said], weights: Weights
) -> tuple[tuple[Array, Array], float, bool]:
    """What all parts ask of tags and calibration, the cost now, and whether that is all."""
    condensed = reduce(merged, [one.condensed for one in said])
    system = System(replace(tags_only, condensed=condensed))
    here = Values(np.zeros((0, 4, 4)), said[0].values.p, said[0].values.calibration)
    belief = replace(system.certain(), surveyed=weights.surveyed)
    point = system.at(here, belief)
    reduced = Reduced(system)
    if not reduced.prepare(point, 0.0, True, free_directions(tags_only, here.p)):
        raise np.linalg.LinAlgError("tags are not determined")
    step = reduced.step(0.0)
    now = _cost(tags_only, said, weights)
    # What the poses alone have to gain is the difference of their costs to what was condensed.
    of_poses = sum(one.cost - one.condensed.cost for one in said)
    converged = step.predicted + of_poses <= TOLERANCE * max(now, 1.0)
    return (step.tags, step.calibration), now, converged


def _cost(tags_only: Problem, said: list[_Said], weights: Weights) -> float:
    """Of everything, where the parts are."""
    system = System(replace(tags_only, condensed=None))
    here = Values(np.zeros((0, 4, 4)), said[0].values.p, said[0].values.calibration)
    belief = replace(system.certain(), surveyed=weights.surveyed)
    return system.at(here, belief).cost + sum(one.cost for one in said)


def _stay(values: Values) -> _Move:
    return _Move(values, np.zeros_like(values.p), np.zeros_like(values.calibration), 0.0)


def _submap(problem: Problem, poses: Index, weights: Weights) -> _Part:
    part = without_surveys(restrict(problem, poses, np.arange(problem.n_tags)))
    inside = np.isin(np.arange(problem.n_poses), poses)
    kept = tuple(
        w[inside[block.pose]] for block, w in zip(problem.sightings, weights.sightings, strict=True)
    )
    steps = weights.odometry[inside[problem.odometry.first]]
    return _Part(replace(part, condensed=None), Weights(kept, steps, np.zeros(0)))


def _gathered(problem: Problem, parts: Sequence[Index], said: list[_Said]) -> State:
    T = np.empty((problem.n_poses, 4, 4))
    for poses, one in zip(parts, said, strict=True):
        T[poses] = one.values.T
    first = said[0].values
    return System(problem).state(Values(T, first.p, first.calibration))


def _check(problem: Problem, parts: Sequence[Index]) -> None:
    owner = np.full(problem.n_poses, -1, dtype=np.int64)
    for number, poses in enumerate(parts):
        owner[poses] = number
    if sum(map(len, parts)) != problem.n_poses or (owner < 0).any():
        raise ValueError("parts: expected every pose in exactly one part")
    first = problem.odometry.first
    cut = np.flatnonzero(owner[first] != owner[first + 1])
    if len(cut):
        raise ValueError(
            f"parts: the odometry step from pose {first[cut[0]]} leaves its part; expected whole "
            "chains"
        )
