"""The incremental peer: GTSAM's iSAM2, set and fed as in its VisualISAM2Example."""

from typing import Any

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from fleet.benchmarks.estimation import peer
from tagmap.conventions import Index
from tagmap.estimation.problem import Problem, State


class Isam2:
    """An update brings the factors that end at new poses. Making factors does not count."""

    def __init__(self, problem: Problem, start: State) -> None:
        self._problem, self._start = problem, start
        options = gtsam.ISAM2Params()
        options.setRelinearizeThreshold(0.01)
        options.relinearizeSkip = 1
        self._solver = gtsam.ISAM2(options)
        self._stereo = peer.stereo_factors(problem)
        self._first = np.searchsorted(problem.sightings[0].pose, np.arange(problem.n_poses + 1))
        self._steps = dict(
            zip((problem.odometry.first + 1).tolist(), peer.step_factors(problem), strict=True)
        )
        self._surveys = dict(
            zip(problem.surveyed.tag.tolist(), peer.survey_factors(problem), strict=True)
        )
        self._known = np.zeros(problem.n_tags, dtype=bool)
        self._next: tuple[Any, Any] = (None, None)

    def prepare(self, poses: Index) -> None:
        factors, values = [], gtsam.Values()
        for i in poses.tolist():
            values.insert(X(i), self._predicted(i, values))
            if i in self._steps:
                factors.append(self._steps[i])
            sightings = slice(self._first[i], self._first[i + 1])
            factors += self._stereo[sightings]
            tags = self._problem.sightings[0].tag[sightings]
            for j in tags[~self._known[tags]].tolist():
                values.insert(L(j), self._start.p[j])
                factors.append(self._surveys[j])
            self._known[tags] = True
        self._next = peer.together(factors), values

    def _predicted(self, i: int, values: Any) -> Any:
        """Odometry from the pose before, at what is known of it; a robot's first pose is given."""
        if i not in self._steps:
            return gtsam.Pose3(self._start.T[i])
        known = values.exists(X(i - 1))
        before = (
            values.atPose3(X(i - 1)) if known else self._solver.calculateEstimatePose3(X(i - 1))
        )
        return before.compose(self._steps[i].measured())

    def update(self) -> None:
        self._solver.update(*self._next)

    def settle(self) -> None:
        """Relinearise what the last update has moved; nothing new comes in."""
        self._solver.update()

    def state(self) -> State:
        found = self._solver.calculateBestEstimate()
        return peer.state_of(found, self._problem.n_poses, self._problem.n_tags)
