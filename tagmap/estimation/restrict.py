"""A part of a joint problem: some of its poses and tags, renumbered."""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Index
from tagmap.estimation.problem import Odometry, Problem, Sightings, Surveyed


def restrict(problem: Problem, poses: Index, tags: Index) -> Problem:
    """The factors among `poses` and `tags` (ascending numbers), renumbered in that order.

    An odometry step stays where both its poses do; a sighting where its pose and its tag do.
    """
    new_pose = _renumbering(problem.n_poses, poses)
    new_tag = _renumbering(problem.n_tags, tags)
    return replace(
        problem,
        n_poses=len(poses),
        n_tags=len(tags),
        odometry=_odometry(problem.odometry, new_pose),
        sightings=tuple(_sightings(block, new_pose, new_tag) for block in problem.sightings),
        surveyed=_surveyed(problem.surveyed, new_tag),
        prior=None,
    )


def without_scales(problem: Problem) -> Problem:
    """The problem with every common scale taken as exactly 1."""
    blocks = tuple(
        replace(block, scale=np.full(len(block), -1, dtype=np.int64)) for block in problem.sightings
    )
    return replace(problem, sightings=blocks, scale_names=(), scale_sigma=np.zeros(0))


def _renumbering(size: int, kept: Index) -> Index:
    new = np.full(size, -1, dtype=np.int64)
    new[kept] = np.arange(len(kept))
    return new


def _odometry(odometry: Odometry, new_pose: Index) -> Odometry:
    first, following = new_pose[odometry.first], new_pose[odometry.first + 1]
    kept = np.flatnonzero((first >= 0) & (following >= 0))
    return replace(odometry.take(kept), first=first[kept])


def _sightings(block: Sightings, new_pose: Index, new_tag: Index) -> Sightings:
    kept = np.flatnonzero((new_pose[block.pose] >= 0) & (new_tag[block.tag] >= 0))
    part = block.take(kept)
    return replace(part, pose=new_pose[part.pose], tag=new_tag[part.tag])


def _surveyed(surveyed: Surveyed, new_tag: Index) -> Surveyed:
    kept = np.flatnonzero(new_tag[surveyed.tag] >= 0)
    return Surveyed(new_tag[surveyed.tag[kept]], surveyed.p[kept], surveyed.whiten[kept])
