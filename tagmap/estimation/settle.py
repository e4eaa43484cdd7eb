"""Optimise, see what the surviving sightings still determine, withhold the rest, repeat."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation import robust
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.points import Points, points_of
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.restrict import restrict, without_calibration, without_surveys
from tagmap.estimation.revote import Votes, revoted
from tagmap.estimation.stack import Stacked
from tagmap.estimation.start import Start, start_from, start_with
from tagmap.estimation.stretches import relaid
from tagmap.estimation.twists import with_motion

INLIER_WEIGHT = 0.5
MOST_VOTES = 3


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

    def sighting_weights(self) -> Array:
        """(K,) of all sightings of `stacked`, block by block; NaN where pose or tag is withheld."""
        return self._of_all(self.optimum.weights.sightings)

    def sighting_chi2(self) -> Array:
        """(K,) squared whitened residuals, likewise."""
        return self._of_all(self.optimum.residuals.sightings)

    def _of_all(self, parts: Sequence[Array]) -> Array:
        whole = []
        for block, part in zip(self.stacked.problem.sightings, parts, strict=True):
            values = np.full(len(block), np.nan)
            values[self.start.placed[block.pose] & self.start.mapped[block.tag]] = part
            whole.append(values)
        return np.concatenate([*whole, np.zeros(0)])


def settle(stacked: Stacked, options: Options) -> Settled:
    """Every round withholds something more, moves tags where more sightings agree, or is the last.

    Only the first few may move tags.
    """
    points = points_of(without_calibration(stacked.problem))
    votes = Votes.of(stacked.problem, points)
    start = start_from(stacked.problem, stacked.chain, points)
    calibration = stacked.problem.prior_mean
    unanchored: Settled | None = None
    tried = np.zeros(stacked.problem.n_poses, dtype=bool)
    for count in itertools.count():
        settled = _optimised(stacked, start, calibration, options)
        left = _still_determined(settled, points)
        calibration = settled.optimum.state.calibration
        if len(calibration):
            votes = votes.at(points_of(stacked.problem, calibration))
        if count < MOST_VOTES:
            votes, left = _better(settled, points, votes, left, tried)
        if left is None:
            break
        if start.anchored and not left.anchored:
            unanchored = settled
        start = left
    settled = _with_motion_as_found(settled, options)
    return _with_marginals(replace(settled, unanchored=unanchored), options)


def _with_motion_as_found(settled: Settled, options: Options) -> Settled:
    """Once more with the motion that the poses show, where the time stamps of a camera are off."""
    stacked, state = settled.stacked, settled.optimum.state
    problem = with_motion(settled.problem, stacked.t_ns[settled.poses], state.T)
    if problem is settled.problem:
        return settled
    again = replace(options, first_mu=robust.SHARPEST)
    return replace(settled, problem=problem, optimum=optimise(problem, state, again))


def _better(
    settled: Settled, points: Points, votes: Votes, left: Start | None, tried: Mask
) -> tuple[Votes, Start | None]:
    """Tags and stretches of poses moved to where they fit; `left` where all of them do."""
    voted = revoted(votes, left or _reached(settled))
    if voted is not None:
        votes, left = voted
    with np.errstate(invalid="ignore"):
        accepted = settled.sighting_weights()[points.row] >= INLIER_WEIGHT
    problem, chain = settled.stacked.problem, settled.stacked.chain
    laid = relaid(problem, points, chain, left or _reached(settled), accepted, tried)
    return votes, laid or left


def _optimised(stacked: Stacked, start: Start, calibration: Array, options: Options) -> Settled:
    poses, tags = np.flatnonzero(start.placed), np.flatnonzero(start.mapped)
    problem = restrict(stacked.problem, poses, tags)
    if not start.anchored:
        problem = without_surveys(problem)
    optimum = optimise(problem, State(start.T[poses], start.p[tags], calibration), options)
    support = np.zeros(len(tags), dtype=np.int64)
    for block, w in zip(problem.sightings, optimum.weights.sightings, strict=True):
        support += np.bincount(block.tag[w >= INLIER_WEIGHT], minlength=len(tags))
    return Settled(stacked, start, poses, tags, problem, optimum, support)


def _reached(settled: Settled) -> Start:
    """The optimum, with the numbers of `stacked`."""
    start, state = settled.start, settled.optimum.state
    T, p = start.T.copy(), start.p.copy()
    T[settled.poses], p[settled.tags] = state.T, state.p
    return replace(start, T=T, p=p)


def _still_determined(settled: Settled, points: Points) -> Start | None:
    """What the accepted sightings and surveys determine; None if that is all there is."""
    part = start_with(
        _with_accepted_surveys(settled),
        settled.stacked.chain[settled.poses],
        settled.optimum.state.T,
        _accepted(settled, points),
    )
    if part.placed.all() and part.mapped.all() and part.anchored == settled.start.anchored:
        return None
    reached = _reached(settled)
    placed, mapped = np.zeros_like(reached.placed), np.zeros_like(reached.mapped)
    placed[settled.poses], mapped[settled.tags] = part.placed, part.mapped
    return replace(reached, placed=placed, mapped=mapped, anchored=part.anchored)


def _with_accepted_surveys(settled: Settled) -> Problem:
    accepted = np.flatnonzero(settled.optimum.weights.surveyed >= INLIER_WEIGHT)
    return replace(settled.problem, surveyed=settled.problem.surveyed.take(accepted))


def _accepted(settled: Settled, points: Points) -> Points:
    """The points of accepted sightings, with the numbers of the settled problem."""
    weights = settled.sighting_weights()
    with np.errstate(invalid="ignore"):
        part = points.take(np.flatnonzero(weights[points.row] >= INLIER_WEIGHT))
    return replace(
        part,
        pose=np.searchsorted(settled.poses, part.pose),
        tag=np.searchsorted(settled.tags, part.tag),
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
        mean = settled.stacked.problem.prior_mean
        return replace(_optimised(settled.stacked, nothing, mean, options), singular=True)
