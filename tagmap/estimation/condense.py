"""Keyframes into what they said: the oldest part of every chain is eliminated for good."""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation import robust
from tagmap.estimation.condensed import Condensed, merged
from tagmap.estimation.elimination import eliminated
from tagmap.estimation.kernels import chain
from tagmap.estimation.kernels.layout import Linear
from tagmap.estimation.optimise import Optimum
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.residuals import Weights
from tagmap.estimation.restrict import restrict
from tagmap.estimation.system import Point, System


def condense(problem: Problem, optimum: Optimum, old: Mask) -> tuple[Problem, State]:
    """The problem and state without the poses `old` (N,), which live on in `condensed`.

    Raises LinAlgError where those poses are not determined by the tags they see.
    """
    gone, kept = np.flatnonzero(old), np.flatnonzero(~old)
    everything = np.arange(problem.n_tags)
    part = replace(restrict(problem, gone, everything), condensed=None)
    part = replace(part, surveyed=part.surveyed.take(np.zeros(0, dtype=np.int64)))
    state = State(optimum.state.T[gone], optimum.state.p, optimum.state.calibration)
    new = condensed_of(part, state, _of_poses(problem, optimum.weights, old))
    left = replace(restrict(problem, kept, everything), condensed=merged(problem.condensed, new))
    return left, replace(optimum.state, T=optimum.state.T[kept])


def condensed_of(problem: Problem, state: State, weights: Weights) -> Condensed:
    """What the sightings of `problem`, without priors, say of tags and calibration alone."""
    system = System(problem)
    point = system.at(system.values(state), system.belief(weights))
    return condensed_at(problem, point, weights)


def factored(linear: Linear) -> tuple[Array, Array]:
    """L and D of A (tagmap.estimation.kernels.chain); LinAlgError if it is not definite."""
    n = len(linear.diagonal)
    L, D = np.zeros((n, 6, 6)), np.zeros((n, 6, 6))
    if not chain.factor(linear, 0.0, L, D, np.zeros((6, 6))):
        raise np.linalg.LinAlgError("poses are not determined by the tags they see")
    return L, D


def condensed_at(problem: Problem, point: Point, weights: Weights) -> Condensed:
    """The same, linearised already."""
    linear = point.linear
    L, D = factored(linear)
    prior = problem.prior_sigma**-2.0
    offset = point.values.calibration - problem.prior_mean
    between, corner = linear.tag_calibration.copy(), linear.calibration - np.diag(prior)
    rows, columns, blocks = eliminated(linear, L, D, between, corner)
    poses = -linear.pose_gradient
    chain.solve(L, D, poses)
    pull, unknown_pull = linear.tag_gradient.copy(), linear.calibration_gradient - prior * offset
    less, unknown_less = np.zeros_like(pull), np.zeros_like(unknown_pull)
    chain.scatter(linear, np.zeros_like(pull), 0.0, poses, less, unknown_less)
    rows, columns, blocks = _with_diagonal(rows, columns, blocks, linear.tag_diagonal - point.own)
    accepted = _accepted(weights)
    gained = -float(np.vdot(poses, linear.pose_gradient))
    return Condensed(
        p=point.values.p,
        calibration=point.values.calibration,
        rows=rows,
        columns=columns,
        blocks=blocks,
        across=between,
        corner=corner,
        pull=pull - less,
        calibration_pull=unknown_pull - unknown_less,
        cost=point.cost - float(prior @ offset**2) - gained,
        n=sum(accepted),
        worth=_worth(problem, accepted),
    )


def _accepted(weights: Weights) -> list[int]:
    """Sightings that count, by block."""
    return [int((w > 0.0).sum()) for w in weights.sightings]


def _worth(problem: Problem, accepted: list[int]) -> float:
    """Mean efficiency of the accepted sightings."""
    blocks = zip(problem.sightings, accepted, strict=True)
    total = sum(n * robust.efficiency(block.z.shape[1]) for block, n in blocks)
    return total / max(sum(accepted), 1)


def _of_poses(problem: Problem, weights: Weights, old: Mask) -> Weights:
    """Of the sightings and steps among the old poses, in the order of the restricted problem."""
    blocks = zip(problem.sightings, weights.sightings, strict=True)
    first = problem.odometry.first
    return Weights(
        tuple(w[old[block.pose]] for block, w in blocks),
        weights.odometry[old[first] & old[first + 1]],
        np.zeros(0),
    )


def _with_diagonal(
    rows: Index, columns: Index, blocks: Array, own: Array
) -> tuple[Index, Index, Array]:
    """Each tag's own block added to the pair with itself; tags nobody saw have none."""
    each = rows == columns
    blocks = blocks.copy()
    blocks[each] += own[rows[each]]
    return rows, columns, blocks
