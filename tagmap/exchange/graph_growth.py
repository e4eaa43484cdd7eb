"""Start values of chains from their edges alone: everything up to some pose, then a little more.

Robust weights do not work on a chain that grows: where a loop closes after a long way, few edges
are right and far off, and would be cut off as wrong. So bounds are WIDE while it grows: wrong names
are still wrong by far more than that, closing loops are not.
"""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.points import Points, fit_tags, points_of
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.restrict import restrict

FIRST_POSES = 50
WIDE = 10.0


@dataclass(frozen=True, slots=True)
class Growing:
    """share: by which the solved part of a chain grows at a time."""

    share: float
    options: Options


PLAIN = Growing(0.25, Options(robust=False, tolerance=1e-3, max_iterations=20))
ROBUST = Growing(0.1, Options(tolerance=1e-3, max_iterations=20, mu_step=10.0, max_regroupings=2))


def grown(problem: Problem, chain: Index, growing: Growing) -> Array:
    """(N, D, D): every chain in the frame of its first pose, or as it is where it has but one."""
    T = np.tile(np.eye(problem.tag_dof + 1), (problem.n_poses, 1, 1))
    points = points_of(problem)
    for poses in np.split(np.arange(len(chain)), np.flatnonzero(np.diff(chain)) + 1):
        part = restrict(problem, poses, np.arange(problem.n_tags))
        T[poses] = _grown_chain(part, points.of_poses(poses[0], poses[-1]), growing)
    return T


def _grown_chain(problem: Problem, points: Points, growing: Growing) -> Array:
    """What would be an outlier to a short piece may be its loop that closes: tags stay."""
    n, T = problem.n_poses, np.tile(np.eye(problem.tag_dof + 1), (problem.n_poses, 1, 1))
    p = np.full((problem.n_tags, problem.tag_dof), np.nan)
    done = 1
    while done < n:
        stop = min(max(done + FIRST_POSES, int((1.0 + growing.share) * done)), n)
        for i in range(done, stop):
            T[i] = T[i - 1] @ problem.odometry.T[i - 1]
        seen = points.of_poses(0, stop - 1)
        new = seen.take(np.flatnonzero(np.isnan(p[seen.tag, 0])))
        fit = fit_tags(new, T, problem.n_tags)
        p[fit.determined] = fit.p[fit.determined]
        known = np.flatnonzero(np.isfinite(p[:, 0]))
        part = restrict(problem, np.arange(stop), known)
        state = optimise(part, State(T[:stop], p[known], np.zeros(0)), growing.options).state
        T[:stop], p[known] = state.T, state.p
        done = stop
    return T


def widened(problem: Problem, times: float) -> Problem:
    """With all errors taken to be so many times as large: the optimum stays, bounds are wider."""
    odometry = replace(problem.odometry, whiten=problem.odometry.whiten / times)
    blocks = (replace(block, whiten=block.whiten / times) for block in problem.sightings)
    return replace(problem, odometry=odometry, sightings=tuple(blocks))
