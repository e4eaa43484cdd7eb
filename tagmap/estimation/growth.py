"""A first trajectory of one odometry chain, grown window by window.

A batch start from dead reckoning is trapped where odometry has turned by radians over an hour.
Growing is not: each window of keyframes starts where the last one ended and is optimised against
the tags known so far, each taken with what the windows before say of it alone. What is lost that
way, the correlation of tags, the joint optimisation brings back; here only start values are made.
"""

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.optimise import Optimiser, Options
from tagmap.estimation.points import Points, fit_tags
from tagmap.estimation.problem import Hold, Problem, State, Surveyed
from tagmap.estimation.restrict import restrict, with_known

WINDOW = 60
FIRST_SIGMA = 1e-4
LEAST_SIGHTINGS = 3.0
WINDOW_OPTIONS = Options(
    max_iterations=30, tolerance=1e-4, mu_step=4.0, max_regroupings=2, robust_surveys=False
)


def grow(problem: Problem, points: Points, poses: Index) -> Array:
    """Poses (n, D, D) of the chain `poses` in the frame of its first one.

    `problem` is without scales and surveys; `points` are those of all its sightings.
    """
    return _Growth(problem, points, poses).run()


class _Growth:
    """What is known so far: tags p (M, d), NaN if not, their information and sightings."""

    def __init__(self, problem: Problem, points: Points, poses: Index) -> None:
        self._problem, self._points, self._poses = problem, points, poses
        d, m = problem.tag_dof, problem.n_tags
        self._p = np.full((m, d), np.nan)
        self._information = np.zeros((m, d, d))
        self._support = np.zeros(m)
        self._hold = np.eye(problem.pose_dof) / FIRST_SIGMA**2

    def run(self) -> Array:
        """Poses (n, D, D)."""
        n, size = len(self._poses), self._problem.tag_dof + 1
        T = np.tile(np.eye(size), (n, 1, 1))
        steps = self._steps()
        start = 0
        while start + 1 < n:
            stop = min(start + WINDOW, n)
            for i in range(start + 1, stop):
                T[i] = T[i - 1] @ steps[i - 1]
            T[start:stop] = self._advance(self._poses[start:stop], T[start:stop])
            start = stop - 1
        return T

    def _steps(self) -> Array:
        """Odometry steps along the chain, (n - 1, D, D)."""
        odometry, poses = self._problem.odometry, self._poses
        first, last = np.searchsorted(odometry.first, [poses[0], poses[-1]])
        return odometry.T[first:last]

    def _advance(self, poses: Index, T: Array) -> Array:
        """Optimise one window of which the first pose is held; remember what it says."""
        seen = self._points.of_poses(poses[0], poses[-1])
        self._place_new_tags(seen, T)
        tags = np.unique(seen.tag)
        tags = tags[np.isfinite(self._p[tags, 0])]
        known = np.flatnonzero(self._support[tags] >= LEAST_SIGHTINGS)
        window = with_known(
            restrict(self._problem, poses, tags),
            Surveyed.known(known, self._p[tags[known]], self._information[tags[known]]),
            Hold(T[0], self._hold),
        )
        optimiser = Optimiser(window, WINDOW_OPTIONS)
        optimum = optimiser.run(State(T, self._p[tags], np.ones(0)))
        for block, w in zip(window.sightings, optimum.weights.sightings, strict=True):
            np.add.at(self._support, tags[block.tag], w)
        self._p[tags] = optimum.state.p
        self._information[tags] = optimiser.tag_information()
        forgotten = tags[self._support[tags] < LEAST_SIGHTINGS]
        self._p[forgotten], self._support[forgotten] = np.nan, 0.0
        self._hold = optimiser.last_information()
        return optimum.state.T

    def _place_new_tags(self, seen: Points, T: Array) -> None:
        unknown = np.flatnonzero(np.isnan(self._p[seen.tag, 0]))
        if len(unknown):
            fit = fit_tags(seen.take(unknown), T, self._problem.n_tags)
            self._p[fit.determined] = fit.p[fit.determined]
