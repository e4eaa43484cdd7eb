"""The joint problem for ever: new keyframes come in, old ones are condensed.

Alive are the latest poses of every chain; all that came before lives on as a Gaussian on the tags.
An update optimises what is alive from where it was, so it costs as much in the thousandth hour as
in the first, however many keyframes there have been.
"""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.condense import with_condensed
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.kept import Kept
from tagmap.estimation.newcomers import place, points_where
from tagmap.estimation.optimise import Optimiser, Optimum, Options
from tagmap.estimation.points import fit_tags
from tagmap.estimation.preconditioner import Precondition
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.restrict import restrict, with_unknowns
from tagmap.estimation.system import Point
from tagmap.estimation.twists import with_motion
from tagmap.estimation.unknowns import Unknown

TOLERANCE = 1e-4
"""Predicted relative decrease that an update may leave: the next one has it too."""
# Products a step that a preconditioner just made would need, and how many more than that in all
# a kept one may cost, by tag: to make one takes as long.
FEW_PRODUCTS = 3
WORTH_PRODUCTS = 0.15


@dataclass(frozen=True, slots=True)
class Span:
    """alive: latest poses of a chain, not condensed; at_once: how many go together.

    idle: updates without a new pose after which a chain goes as a whole.
    """

    alive: int = 40
    at_once: int = 40
    idle: int = 50


class Lifelong:
    """Feed it the problem of the poses that are alive, and of new ones, with `update`.

    Poses are known by ids, ascending along the problem; tags by their numbers, which stay.

    ids (n,), T (n, D, D): poses alive after the last update. waiting: ids of those that nothing
    says where they are; they may be given again. p (M, d), NaN where unknown; tags: numbers of
    those known. unknowns, calibration (Q,): all there ever were, and their values.
    last: the problem and optimum of the last update, before anything was condensed at its end;
    solved: the ids of its poses.
    """

    def __init__(self, options: Options | None = None, span: Span | None = None) -> None:
        self._options = replace(options or Options(tolerance=TOLERANCE), confirm=False)
        self._span = span or Span()
        self.ids: Index = np.zeros(0, dtype=np.int64)
        self.solved: Index = self.ids
        self.waiting: Index = self.ids
        self.T: Array = np.zeros((0, 0, 0))
        self.p: Array = np.zeros((0, 0))
        self.unknowns: tuple[Unknown, ...] = ()
        self.calibration: Array = np.zeros(0)
        self.tags: Index = np.zeros(0, dtype=np.int64)
        self.condensed: Condensed | None = None
        self.last: tuple[Problem, Optimum] | None = None
        self._taken: tuple[Index, Condensed] | None = None
        self._kept: Kept | None = None
        self._wasted = 0
        self._updates = 0
        self._came: Index = np.zeros(0, dtype=np.int64)

    def update(
        self,
        problem: Problem,
        ids: Index,
        T_given: Array | None = None,
        t_ns: Index | None = None,
    ) -> Optimum:
        """Take in new poses; those that are condensed now are missing from `ids` afterwards.

        problem: of all poses `ids` (n,), without what is condensed. T_given (n, D, D): where poses
        are that nothing else says it of, NaN elsewhere; without it they are laid onto the map.
        t_ns (n,): time stamps, where a time offset is an unknown: then its sightings are taken with
        the motion that the poses show.
        """
        self._updates += 1
        problem = self._with_all_unknowns(problem)
        self._make_room(problem)
        T = self._known_poses(problem, ids)
        place(problem, T, T_given, self.p)
        placed = np.isfinite(T[:, 0, 0])
        self._add_tags(problem, T, placed)
        poses, tags = np.flatnonzero(placed), np.flatnonzero(np.isfinite(self.p[:, 0]))
        alive = replace(restrict(problem, poses, tags), condensed=self._known(tags))
        if t_ns is not None:
            alive = with_motion(alive, t_ns[poses], T[poses])
        optimum = self._optimise(alive, State(T[poses], self.p[tags], self.calibration), tags)
        self._came = self._when(ids[poses])
        self.ids = self.solved = ids[poses]
        self.T, self.tags = optimum.state.T, tags
        self.waiting = _latest(problem, ids, ~placed, self._span.alive)
        self.last = alive, optimum
        self.p[tags], self.calibration = optimum.state.p, optimum.state.calibration
        self._condense(alive, optimum, tags)
        return optimum

    def _with_all_unknowns(self, problem: Problem) -> Problem:
        """The problem with the calibration unknowns of all robots that ever were, in one order."""
        if problem.calibration == self.unknowns:
            return problem
        before = len(self.unknowns)
        problem = with_unknowns(problem, self.unknowns)
        self.unknowns = problem.calibration
        self.calibration = np.concatenate([self.calibration, problem.prior_mean[before:]])
        if self.condensed is not None:
            self.condensed = self.condensed.with_unknowns(np.arange(before), self.calibration)
            self._taken = None
        return problem

    def _make_room(self, problem: Problem) -> None:
        """For tags that were not there before."""
        new, d = problem.n_tags - len(self.p), problem.tag_dof
        if not new:
            return
        self.p = np.vstack([self.p.reshape(-1, d), np.full((new, d), np.nan)])
        if self.condensed is not None:
            before = np.arange(len(self.condensed.p))
            self.condensed = self.condensed.among(before, problem.n_tags)

    def _known_poses(self, problem: Problem, ids: Index) -> Array:
        """T (n, D, D) of the last update, NaN where new."""
        size = problem.tag_dof + 1
        T = np.full((len(ids), size, size), np.nan)
        at, found = _found(ids, self.ids)
        T[at[found]] = self.T.reshape(-1, size, size)[found]
        return T

    def _when(self, ids: Index) -> Index:
        """In which update each pose came."""
        came = np.full(len(ids), self._updates, dtype=np.int64)
        at, found = _found(ids, self.ids)
        came[at[found]] = self._came[found]
        return came

    def _add_tags(self, problem: Problem, T: Array, placed: Mask) -> None:
        """Tags that placed poses see and nobody knew."""
        unknown = np.isnan(self.p[:, 0])
        if not unknown.any():
            return
        new = [unknown[block.tag] & placed[block.pose] for block in problem.sightings]
        if any(part.any() for part in new):
            fit = fit_tags(points_where(problem, new), T, problem.n_tags)
            self.p[fit.determined] = fit.p[fit.determined]

    def _known(self, tags: Index) -> Condensed | None:
        """What is condensed, of these tags, turned as the map is now."""
        if self.condensed is None:
            return None
        if self._taken is None or not np.array_equal(self._taken[0], tags):
            self._taken = tags, self.condensed.take(tags)
        self._taken = tags, self._taken[1].aligned(self.p[tags])
        return self._taken[1]

    def _optimise(self, alive: Problem, start: State, tags: Index) -> Optimum:
        """With a preconditioner that is kept while it saves more than it costs."""

        def precondition(point: Point) -> Precondition | None:
            outworn = self._wasted > WORTH_PRODUCTS * len(tags)
            found = None if outworn or self._kept is None else self._kept.at(point, tags)
            if found is None:
                self._kept, self._wasted = Kept.of(point, alive, tags), 0
                found = None if self._kept is None else self._kept.at(point, tags)
            return found

        optimiser = Optimiser(alive, self._options, precondition)
        optimum = optimiser.run(start)
        self._wasted += max(0, optimiser.products - FEW_PRODUCTS * optimum.iterations)
        return optimum

    def _condense(self, alive: Problem, optimum: Optimum, tags: Index) -> None:
        """The oldest poses of chains that have become too long, and chains that have ended."""
        old = _old(alive, self._span, self._updates - self._came)
        if not old.any():
            return
        taken = with_condensed(alive, optimum, old)
        self.condensed = taken.among(tags, len(self.p))
        self._taken = tags, taken
        self.ids, self.T, self._came = self.ids[~old], self.T[~old], self._came[~old]


def _found(ids: Index, wanted: Index) -> tuple[Index, Mask]:
    """Places in ids, ascending, of those wanted, and which of them are there."""
    at = np.minimum(np.searchsorted(ids, wanted), len(ids) - 1)
    found: Mask = ids[at] == wanted
    return at, found


def _old(problem: Problem, span: Span, age: Index) -> Mask:
    """Which poses go: whole lots of `at_once` from the beginning of each chain, or all of it.

    age (N,): updates since each pose came.
    """
    chain, starts = _chains(problem)
    length = np.diff(np.append(starts, problem.n_poses))
    going = np.maximum(length - span.alive, 0) // span.at_once * span.at_once
    ended = np.minimum.reduceat(age, starts) >= span.idle if len(starts) else going > 0
    going = np.where(ended, length, going)
    place = np.arange(problem.n_poses) - starts[chain]
    old: Mask = place < going[chain]
    return old


def _latest(problem: Problem, ids: Index, wanted: Mask, most: int) -> Index:
    """Of the wanted poses of each chain the ids of the last `most`."""
    if not wanted.any():
        return ids[:0]
    chain, starts = _chains(problem)
    end = np.append(starts[1:], problem.n_poses)[chain]
    return ids[wanted & (end - np.arange(problem.n_poses) <= most)]


def _chains(problem: Problem) -> tuple[Index, Index]:
    """Which chain each pose belongs to (N,), and the first pose of each."""
    breaks = np.ones(problem.n_poses, dtype=np.int64)
    breaks[problem.odometry.first + 1] = 0
    return np.cumsum(breaks) - 1, np.flatnonzero(breaks)
