"""Where poses are that are new to a map that lives on."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.local_maps import LEAST_SIGMA_M, local_map
from tagmap.estimation.merge import LocalMap, align_maps
from tagmap.estimation.points import Points, points_of
from tagmap.estimation.problem import Problem, lie
from tagmap.estimation.restrict import without_calibration


def place(problem: Problem, T: Array, T_given: Array | None, p: Array) -> None:
    """Fill in those of T (N, D, D) that are NaN, where anything says where they are.

    Odometry from a pose that is known, before or after; T_given (N, D, D), NaN where nothing is
    given; or what a stretch of poses sees of the tags, p (M, d), NaN where unknown.
    """
    if not np.isnan(T[:, 0, 0]).any():
        return
    step = np.full(problem.n_poses, -1, dtype=np.int64)
    step[problem.odometry.first] = np.arange(len(problem.odometry.first))
    _follow(problem, step, T, T_given)
    for first, last in _stretches(step, np.isnan(T[:, 0, 0])):
        own = _reckoned(problem, step, first, last)
        T_map_stretch = _laid(problem, own, first, p)
        if T_map_stretch is not None:
            T[first : last + 1] = T_map_stretch @ own


def points_where(problem: Problem, which: list[Mask]) -> Points:
    """Of some of the sightings of each block."""
    pairs = zip(problem.sightings, which, strict=True)
    part = replace(
        problem,
        sightings=tuple(block.take(np.flatnonzero(keep)) for block, keep in pairs),
        condensed=None,
    )
    return points_of(without_calibration(part))


def _follow(problem: Problem, step: Index, T: Array, T_given: Array | None) -> None:
    """Along odometry from what is known or given, forth and then back."""
    steps = problem.odometry.T
    for i in np.flatnonzero(np.isnan(T[:, 0, 0])).tolist():
        if i > 0 and step[i - 1] >= 0 and np.isfinite(T[i - 1, 0, 0]):
            T[i] = T[i - 1] @ steps[step[i - 1]]
        elif T_given is not None:
            T[i] = T_given[i]
    for i in np.flatnonzero(np.isnan(T[:-1, 0, 0]))[::-1].tolist():
        if step[i] >= 0 and np.isfinite(T[i + 1, 0, 0]):
            T[i] = T[i + 1] @ lie(problem.kind).inverse(steps[step[i]])


def _stretches(step: Index, wanted: Mask) -> Iterator[tuple[int, int]]:
    """First and last of the wanted poses that odometry holds together."""
    poses = np.flatnonzero(wanted)
    apart = (np.diff(poses) > 1) | (step[poses[:-1]] < 0)
    for run in np.split(poses, np.flatnonzero(apart) + 1):
        if len(run):
            yield int(run[0]), int(run[-1])


def _reckoned(problem: Problem, step: Index, first: int, last: int) -> Array:
    """Poses first..last by odometry alone, from identity."""
    T = np.tile(np.eye(problem.tag_dof + 1), (last - first + 1, 1, 1))
    for i in range(last - first):
        T[i + 1] = T[i] @ problem.odometry.T[step[first + i]]
    return T


def _laid(problem: Problem, own: Array, first: int, p: Array) -> Array | None:
    """T_map_stretch by what its poses see of known tags; None if that does not determine it."""
    last = first + len(own) - 1
    known = np.isfinite(p[:, 0])
    seen = points_where(
        problem,
        [
            (block.pose >= first) & (block.pose <= last) & known[block.tag]
            for block in problem.sightings
        ],
    )
    mapped = np.flatnonzero(known)
    local = local_map(seen.of_poses(first, last), own, problem.n_tags)
    target = LocalMap(mapped, p[mapped], np.full(len(mapped), LEAST_SIGMA_M))
    found = align_maps(problem.kind, local, target)
    return None if found is None else found.T
