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

# Added to what is known of poses, so that those that could still move can be eliminated: as
# little as rounding adds, of which the tags learn next to nothing.
LOOSE = 1e-10


def condense(problem: Problem, optimum: Optimum, old: Mask) -> tuple[Problem, State]:
    """The problem and state without the poses `old` (N,), which live on in `condensed`."""
    kept = np.flatnonzero(~old)
    left = restrict(problem, kept, np.arange(problem.n_tags))
    left = replace(left, condensed=with_condensed(problem, optimum, old))
    return left, replace(optimum.state, T=optimum.state.T[kept])


def with_condensed(problem: Problem, optimum: Optimum, old: Mask) -> Condensed:
    """What `problem` holds condensed, and what the poses `old` (N,) say besides.

    Poses that the tags they see do not determine say what they can.
    """
    gone = np.flatnonzero(old)
    part = replace(problem, condensed=None, surveyed=problem.surveyed.take(gone[:0]))
    part = restrict(part, gone, np.arange(problem.n_tags))
    system = System(part)
    state = State(optimum.state.T[gone], optimum.state.p, optimum.state.calibration)
    weights = _of_poses(problem, optimum.weights, old)
    point = system.at(system.values(state), system.belief(weights))
    return merged(problem.condensed, condensed_at(part, point, weights, LOOSE))


def factored(linear: Linear, damping: float = 0.0) -> tuple[Array, Array]:
    """L and D of A (tagmap.estimation.kernels.chain); LinAlgError if it is not definite."""
    n = len(linear.diagonal)
    L, D = np.zeros((n, 6, 6)), np.zeros((n, 6, 6))
    if not chain.factor(linear, damping, L, D, np.zeros((6, 6))):
        raise np.linalg.LinAlgError("poses are not determined by the tags they see")
    return L, D


def condensed_at(
    problem: Problem, point: Point, weights: Weights, damping: float = 0.0
) -> Condensed:
    """What the sightings of a linearised problem, without priors, say of all but the poses.

    damping: part by which what is known of each pose is raised.
    """
    linear = point.linear
    L, D = factored(linear, damping)
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
    """Pairs ascending, each tag's own block added to that with itself; unseen tags have none."""
    order = np.argsort(rows * len(own) + columns)
    rows, columns, blocks = rows[order], columns[order], blocks[order]
    each = rows == columns
    blocks[each] += own[rows[each]]
    return rows, columns, blocks
