"""Stretches of poses that fit nothing around them, laid onto the map anew by what they see.

Behind a slip of the wheels a part of a chain may be held in the wrong place: what it sees is then
cut off as wrong, and the cut does not mend. On a map that stands, such a part finds its place by
the shape of what it sees: odometry is good inside it, or inside halves of it.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.local_maps import LEAST_SIGMA_M
from tagmap.estimation.merge import LocalMap, align_maps, least_shared
from tagmap.estimation.points import Points, fit_tags
from tagmap.estimation.problem import Problem, lie
from tagmap.estimation.start import Start

LEAST_RUN = 8
LEAST_POSES = 3
LEAST_SPARE = 1
SHARE = 0.5


def relaid(
    problem: Problem, points: Points, chain: Index, start: Start, accepted: Mask, tried: Mask
) -> Start | None:
    """`start` with such stretches moved; None where there are none that find a place.

    points: of all sightings; accepted (K,): which of these count at the optimum, whose T and p
    `start` has. chain (N,): number of the odometry chain of each pose. tried (N,): poses of
    stretches that had their chance; these are added.
    """
    tags = np.flatnonzero(start.mapped)
    target = LocalMap(tags, start.p[tags], np.full(len(tags), LEAST_SIGMA_M))
    T, moved = start.T.copy(), False
    for first, last in _stretches(points, chain, start, accepted):
        if not tried[first : last + 1].any():
            moved |= _lay(problem, points, target, _reckoned(problem, first, last), first, T)
        tried[first : last + 1] = True
    return replace(start, T=T) if moved else None


def _stretches(
    points: Points, chain: Index, start: Start, accepted: Mask
) -> Iterator[tuple[int, int]]:
    """First and last pose of runs in which no pose has half of its sightings accepted."""
    judged = start.placed[points.pose] & start.mapped[points.tag]
    n = len(start.T)
    seen = np.bincount(points.pose[judged], minlength=n)
    kept = np.bincount(points.pose[judged & accepted], minlength=n)
    bad = np.flatnonzero((seen > 1) & (kept < SHARE * seen))
    good = np.concatenate([[0], np.cumsum((seen > 0) & (kept >= SHARE * seen))])
    apart = (np.diff(good[bad]) > 0) | (np.diff(chain[bad]) > 0)
    for run in np.split(bad, np.flatnonzero(apart) + 1):
        if len(run) >= LEAST_RUN:
            yield int(run[0]), int(run[-1])


def _reckoned(problem: Problem, first: int, last: int) -> Array:
    """Poses first..last by odometry alone, from identity."""
    odometry = problem.odometry
    T = np.tile(np.eye(problem.tag_dof + 1), (last - first + 1, 1, 1))
    begin = int(np.searchsorted(odometry.first, first))
    for i in range(last - first):
        T[i + 1] = T[i] @ odometry.T[begin + i]
    return T


def _lay(
    problem: Problem, points: Points, target: LocalMap, own: Array, first: int, T: Array
) -> bool:
    """Set the poses of one stretch in T, or of those halves of it that fit; False if none does."""
    n, kind = len(own), problem.kind
    fit = fit_tags(points.of_poses(first, first + n - 1), own, problem.n_tags)
    tags = np.flatnonzero(fit.determined)
    local = LocalMap(tags, fit.p[tags], np.full(len(tags), LEAST_SIGMA_M))
    found = align_maps(kind, local, target)
    if found is not None and found.agreeing >= least_shared(kind) + LEAST_SPARE:
        T[first : first + n] = found.T @ own
        return True
    if n < 2 * LEAST_POSES:
        return False
    half = n // 2
    turned = lie(kind).inverse(own[half]) @ own[half:]
    before = _lay(problem, points, target, own[:half], first, T)
    return _lay(problem, points, target, turned, first + half, T) or before
