"""A part of a joint problem: some of its poses and tags, renumbered."""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Index
from tagmap.estimation.problem import Odometry, Problem, Sightings, Surveyed
from tagmap.estimation.unknowns import Unknown


def restrict(problem: Problem, poses: Index, tags: Index) -> Problem:
    """The factors among `poses` and `tags` (ascending numbers), renumbered in that order.

    An odometry step stays where both its poses do; a sighting where its pose and its tag do.
    """
    if len(poses) == problem.n_poses and len(tags) == problem.n_tags:
        return problem
    new_tag = _renumbering(problem.n_tags, tags)
    return replace(
        problem,
        n_poses=len(poses),
        n_tags=len(tags),
        odometry=_odometry(problem.odometry, poses),
        sightings=tuple(_sightings(block, poses, new_tag) for block in problem.sightings),
        surveyed=_surveyed(problem.surveyed, new_tag),
        condensed=None if problem.condensed is None else problem.condensed.take(tags),
    )


def without_calibration(problem: Problem) -> Problem:
    """The problem with every sensor taken to be as stated."""
    condensed = problem.condensed
    return replace(
        problem,
        sightings=tuple(replace(block, unknowns=(), twist=None) for block in problem.sightings),
        odometry=replace(problem.odometry, unknowns=None),
        calibration=(),
        condensed=condensed and condensed.without_unknowns(problem.prior_mean),
    )


def with_unknowns(problem: Problem, known: tuple[Unknown, ...]) -> Problem:
    """The same with these calibration unknowns first, then others of its own; the widest priors."""
    places = {(unknown.name, unknown.robot): i for i, unknown in enumerate(known)}
    unknowns = list(known)
    for unknown in problem.calibration:
        at = places.setdefault((unknown.name, unknown.robot), len(unknowns))
        if at == len(unknowns):
            unknowns.append(unknown)
        elif unknown.sigma > unknowns[at].sigma:
            unknowns[at] = unknown
    new = np.array([places[u.name, u.robot] for u in problem.calibration] + [-1], dtype=np.int64)
    steps = problem.odometry
    return replace(
        problem,
        sightings=tuple(
            replace(block, unknowns=tuple(new[list(block.unknowns)].tolist()))
            for block in problem.sightings
        ),
        odometry=steps if steps.unknowns is None else replace(steps, unknowns=new[steps.unknowns]),
        calibration=tuple(unknowns),
    )


def without_surveys(problem: Problem) -> Problem:
    """The problem of the robots alone."""
    return replace(problem, surveyed=problem.surveyed.take(np.zeros(0, dtype=np.int64)))


def _renumbering(size: int, kept: Index) -> Index:
    new = np.full(size, -1, dtype=np.int64)
    new[kept] = np.arange(len(kept))
    return new


def _span(ascending: Index, poses: Index) -> slice:
    """Where in `ascending` pose numbers those from poses[0] to poses[-1] lie."""
    if not len(poses):
        return slice(0, 0)
    start, stop = np.searchsorted(ascending, [poses[0], poses[-1] + 1])
    return slice(int(start), int(stop))


def _among(numbers: Index, poses: Index) -> Index:
    """The place of each number in `poses`, -1 where it is not there."""
    at = np.minimum(np.searchsorted(poses, numbers), len(poses) - 1)
    found: Index = np.where(poses[at] == numbers, at, -1)
    return found


def _odometry(odometry: Odometry, poses: Index) -> Odometry:
    part = odometry.take(_span(odometry.first, poses))
    if not len(part.first):
        return part
    first, following = _among(part.first, poses), _among(part.first + 1, poses)
    kept = (first >= 0) & (following >= 0)
    if kept.all():
        return replace(part, first=first)
    return replace(part.take(np.flatnonzero(kept)), first=first[kept])


def _sightings(block: Sightings, poses: Index, new_tag: Index) -> Sightings:
    part = block.take(_span(block.pose, poses))
    if not len(part):
        return part
    pose, tag = _among(part.pose, poses), new_tag[part.tag]
    kept = (pose >= 0) & (tag >= 0)
    if kept.all():
        return replace(part, pose=pose, tag=tag)
    return replace(part.take(np.flatnonzero(kept)), pose=pose[kept], tag=tag[kept])


def _surveyed(surveyed: Surveyed, new_tag: Index) -> Surveyed:
    part = surveyed.take(np.flatnonzero(new_tag[surveyed.tag] >= 0))
    return replace(part, tag=new_tag[part.tag])
