"""Optimise, see what the surviving sightings still determine, withhold the rest, repeat."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from tagmap.conventions import Array, Index
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.residuals import Weights
from tagmap.estimation.restrict import restrict, without_surveys
from tagmap.estimation.stack import Stacked
from tagmap.estimation.start import Start, start_at, start_from_nothing

INLIER_WEIGHT = 0.5


@dataclass(frozen=True, slots=True)
class Settled:
    """The optimum over the placed poses and mapped tags, and the numbers they have in `stacked`.

    support (M,): accepted sightings per tag. marginals: None when there is no tag.
    unanchored: the optimum that put so many surveyed tags in doubt that the rest fix no frame.
    singular: nothing is published, as the covariances cannot be computed.
    """

    stacked: Stacked
    start: Start
    poses: Index
    tags: Index
    problem: Problem
    optimum: Optimum
    support: Index
    marginals: Marginals | None = None
    unanchored: "Settled | None" = None
    singular: bool = False


def settle(stacked: Stacked, options: Options) -> Settled:
    """Every round withholds something more, or is the last."""
    start = start_from_nothing(stacked.problem, stacked.chain)
    scale = np.ones(len(stacked.problem.scale_names))
    unanchored: Settled | None = None
    while True:
        settled = _optimised(stacked, start, scale, options)
        left = _still_determined(settled)
        if left is None:
            break
        if start.anchored and not left.anchored:
            unanchored = settled
        start, scale = left, settled.optimum.state.scale
    return _with_marginals(replace(settled, unanchored=unanchored), options)


def _optimised(stacked: Stacked, start: Start, scale: Array, options: Options) -> Settled:
    poses, tags = np.flatnonzero(start.placed), np.flatnonzero(start.mapped)
    problem = restrict(stacked.problem, poses, tags)
    if not start.anchored:
        problem = without_surveys(problem)
    optimum = optimise(problem, State(start.T[poses], start.p[tags], scale), options)
    support = np.zeros(len(tags), dtype=np.int64)
    for block, w in zip(problem.sightings, optimum.weights.sightings, strict=True):
        support += np.bincount(block.tag[w >= INLIER_WEIGHT], minlength=len(tags))
    return Settled(stacked, start, poses, tags, problem, optimum, support)


def _still_determined(settled: Settled) -> Start | None:
    """What the accepted sightings and surveys determine; None if that is all there is."""
    start, state = settled.start, settled.optimum.state
    accepted = _accepted(settled.problem, settled.optimum.weights)
    part = start_at(accepted, settled.stacked.chain[settled.poses], state.T)
    if part.placed.all() and part.mapped.all() and part.anchored == start.anchored:
        return None
    T, p = start.T.copy(), start.p.copy()
    T[settled.poses], p[settled.tags] = state.T, state.p
    placed, mapped = np.zeros_like(start.placed), np.zeros_like(start.mapped)
    placed[settled.poses], mapped[settled.tags] = part.placed, part.mapped
    return Start(T, p, placed, mapped, part.anchored)


def _accepted(problem: Problem, weights: Weights) -> Problem:
    blocks = zip(problem.sightings, weights.sightings, strict=True)
    return replace(
        problem,
        sightings=tuple(block.take(np.flatnonzero(w >= INLIER_WEIGHT)) for block, w in blocks),
        surveyed=problem.surveyed.take(np.flatnonzero(weights.surveyed >= INLIER_WEIGHT)),
    )


def _with_marginals(settled: Settled, options: Options) -> Settled:
    """Without covariances nothing is published: a position is only worth what is known of it."""
    if not len(settled.tags):
        return settled
    try:
        return replace(settled, marginals=Marginals(settled.problem, settled.optimum))
    except linalg.LinAlgError:
        start = settled.start
        nothing = replace(
            start, placed=np.zeros_like(start.placed), mapped=np.zeros_like(start.mapped)
        )
        scale = np.ones_like(settled.optimum.state.scale)
        return replace(_optimised(settled.stacked, nothing, scale, options), singular=True)
