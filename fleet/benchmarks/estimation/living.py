"""Our map that lives on, as plain least squares: no robust weights, as the peer does it."""

import numpy as np

from tagmap.conventions import Index
from tagmap.estimation.follow import followed
from tagmap.estimation.lifelong import TOLERANCE, Lifelong
from tagmap.estimation.optimise import Options
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.restrict import restrict

OPTIONS = Options(robust=False, tolerance=TOLERANCE)


class Living:
    """An update brings the poses that are alive and the new ones. Stacking these does not count.

    What it begins from is what the peer is given: a robot's first pose, and tags at first sight.
    """

    def __init__(self, problem: Problem, start: State) -> None:
        self._problem, self._start = problem, start
        self._life = Lifelong(OPTIONS)
        self._life.p = np.full_like(start.p, np.nan)
        self._first = np.ones(problem.n_poses, dtype=bool)
        self._first[problem.odometry.first + 1] = False
        self._T = start.T.copy()
        self._ids = np.zeros(0, dtype=np.int64)
        self._part = problem

    def prepare(self, poses: Index) -> None:
        self._ids = np.union1d(self._life.ids, poses)
        self._part = restrict(self._problem, self._ids, np.arange(self._problem.n_tags))
        seen = np.unique(self._part.sightings[0].tag)
        new = seen[np.isnan(self._life.p[seen, 0])]
        self._life.p[new] = self._start.p[new]
        self._given = np.where(self._first[:, None, None], self._start.T, np.nan)[self._ids]

    def update(self) -> None:
        self._life.update(self._part, self._ids, self._given)
        assert self._life.last is not None
        self._T[self._life.solved] = self._life.last[1].state.T

    def settle(self) -> None:
        """Poses that were condensed follow what the map has learnt since."""
        self._T = followed(self._problem, self.state()).T

    def state(self) -> State:
        return State(self._T, self._life.p, self._life.calibration)
