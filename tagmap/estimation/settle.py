"""Optimise, see what the surviving sightings still determine, withhold the rest, repeat."""

import itertools
from dataclasses import replace

import numpy as np
from scipy import linalg

from tagmap.conventions import Array, Mask
from tagmap.estimation import robust
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.known import HELD_M, Vague, vague
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.points import Points, points_of
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.restrict import restrict, without_calibration, without_surveys
from tagmap.estimation.revote import Votes, revoted
from tagmap.estimation.settled import INLIER_WEIGHT, Open, Settled
from tagmap.estimation.stack import Stacked
from tagmap.estimation.start import Start, start_from, start_with
from tagmap.estimation.stretches import relaid
from tagmap.estimation.twists import with_motion

MOST_VOTES = 3


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
    return replace(_known_part(settled, points, options), unanchored=unanchored)


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
    voted = revoted(votes, left or settled.reached())
    if voted is not None:
        votes, left = voted
    with np.errstate(invalid="ignore"):
        accepted = settled.sighting_weights()[points.row] >= INLIER_WEIGHT
    problem, chain = settled.stacked.problem, settled.stacked.chain
    laid = relaid(problem, points, chain, left or settled.reached(), accepted, tried)
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
    reached = settled.reached()
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


def _known_part(settled: Settled, points: Points, options: Options) -> Settled:
    """Without covariances nothing is published: a position is only worth what is known of it.

    What is not known well enough goes, and with it what then is determined no more.
    """
    opened: dict[int, Open] = {}
    loose: Open | None = None
    while len(settled.tags):
        marginals, found = judged(settled, np.ones(len(settled.tags)))
        if found is None:
            found_all = replace(settled, marginals=marginals, opened=opened, loose=loose)
            return found_all if marginals is not None else _nothing(found_all, options)
        opened |= {int(settled.tags[i]): way for i, way in found.tags.items()}
        loose = found.frame or loose
        settled = _without(settled, found, points, options)
    return replace(settled, opened=opened, loose=loose)


def judged(settled: Settled, slack: Array) -> tuple[Marginals | None, Vague | None]:
    """Covariances, None where they cannot be computed, and what they say should not be told.

    Where they cannot something is not known at all, which shows if all is held a little.
    """
    for held_m in (np.inf, HELD_M):
        try:
            marginals = Marginals(settled.problem, settled.optimum, held_m)
            found = vague(settled, marginals, slack)
        except linalg.LinAlgError:
            continue
        return (None if found is None and held_m < np.inf else marginals), found
    return None, None


def without(start: Start, settled: Settled, found: Vague) -> Start:
    """`start` less what is vague."""
    placed, mapped = start.placed.copy(), start.mapped.copy()
    placed[settled.poses[found.poses]] = False
    mapped[settled.tags[list(found.tags)]] = False
    anchored = start.anchored and found.frame is None
    return replace(start, placed=placed, mapped=mapped, anchored=anchored)


def _without(settled: Settled, found: Vague, points: Points, options: Options) -> Settled:
    """The optimum of the rest, which is nearly where it was."""
    again = replace(options, first_mu=robust.SHARPEST)
    left: Start | None = without(settled.reached(), settled, found)
    while left is not None:
        settled = _optimised(settled.stacked, left, settled.optimum.state.calibration, again)
        left = _still_determined(settled, points)
    return _with_motion_as_found(settled, options)


def _nothing(settled: Settled, options: Options) -> Settled:
    """Nothing is placed."""
    start = settled.start
    nothing = replace(start, placed=np.zeros_like(start.placed), mapped=np.zeros_like(start.mapped))
    mean = settled.stacked.problem.prior_mean
    return replace(_optimised(settled.stacked, nothing, mean, options), singular=True)
