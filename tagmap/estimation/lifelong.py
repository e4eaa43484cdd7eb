"""The joint problem for ever: new keyframes come in, old ones are condensed.

Alive are the latest poses of every chain; all that came before lives on as a Gaussian on the tags.
An update optimises what is alive from where it was, so it costs as much in the thousandth hour as
in the first, however many keyframes there have been.
"""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.condense import condense
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.optimise import Optimiser, Optimum, Options
from tagmap.estimation.points import Points, fit_tags, points_of
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.reduced import Precondition
from tagmap.estimation.restrict import restrict, without_calibration
from tagmap.geometry.alignment import align

LEAST_SHARED = 3
# Updates that one preconditioner serves.
KEPT = 10


@dataclass(frozen=True, slots=True)
class Span:
    """alive: latest poses of a chain, not condensed; at_once: how many go together."""

    alive: int = 200
    at_once: int = 100


class Lifelong:
    """Feed it the problem of the poses that are alive, and of new ones, with `update`.

    Poses are known by ids, ascending along the problem; tags by their numbers, which stay. `ids`
    are those alive after the last update, T (n, D, D) their poses; p (M, d), NaN where unknown;
    tags: numbers of those known. last: the problem and optimum of the last update, before anything
    was condensed at its end.
    """

    def __init__(self, options: Options | None = None, span: Span | None = None) -> None:
        self._options, self._span = options or Options(tolerance=1e-6), span or Span()
        self.ids: Index = np.zeros(0, dtype=np.int64)
        self.T: Array = np.zeros((0, 0, 0))
        self.p: Array = np.zeros((0, 0))
        self.calibration: Array = np.zeros(0)
        self.tags: Index = np.zeros(0, dtype=np.int64)
        self.condensed: Condensed | None = None
        self.last: tuple[Problem, Optimum] | None = None
        self._taken: tuple[Index, Condensed] | None = None
        self._precondition: tuple[Index, Precondition | None, int] | None = None

    def update(self, problem: Problem, ids: Index, T_given: Array | None = None) -> Optimum:
        """Take in new poses; those that are condensed now are missing from `ids` afterwards.

        problem: of all poses `ids` (n,), without what is condensed. T_given (n, D, D): where poses
        are that nothing else says it of, NaN elsewhere; without it they are laid onto the map.
        """
        self._grow(problem)
        T, placed = self._start(problem, ids, T_given)
        self._add_tags(problem, T, placed)
        tags = np.flatnonzero(np.isfinite(self.p[:, 0]))
        poses = np.flatnonzero(placed)
        alive = replace(restrict(problem, poses, tags), condensed=self._known(tags))
        optimum = self._optimise(alive, State(T[poses], self.p[tags], self.calibration), tags)
        self.ids, self.T, self.tags = ids[poses], optimum.state.T, tags
        self.last = alive, optimum
        self.p[tags], self.calibration = optimum.state.p, optimum.state.calibration
        self._condense(alive, optimum, tags)
        return optimum

    def _known(self, tags: Index) -> Condensed | None:
        """What is condensed, of these tags, laid onto the map as it is now."""
        if self.condensed is None:
            return None
        if self._taken is None or not np.array_equal(self._taken[0], tags):
            self._taken = tags, self.condensed.take(tags)
        self._taken = tags, self._taken[1].aligned(self.p[tags])
        return self._taken[1]

    def _optimise(self, alive: Problem, start: State, tags: Index) -> Optimum:
        """With the preconditioner of the updates before while the tags are the same."""
        used = self._precondition
        fresh = used is None or used[2] >= KEPT or not np.array_equal(used[0], tags)
        options = replace(self._options, renewals=int(fresh))
        given = None if used is None or fresh else used[1]
        optimiser = Optimiser(alive, options, given)
        optimum = optimiser.run(start)
        age = 0 if fresh or used is None else used[2] + 1
        self._precondition = (tags, optimiser.precondition, age)
        return optimum

    def _grow(self, problem: Problem) -> None:
        """Room for tags and unknowns that were not there before."""
        new = problem.n_tags - len(self.p)
        d = problem.tag_dof
        self.p = np.vstack([self.p.reshape(-1, d), np.full((new, d), np.nan)])
        if not len(self.calibration):
            self.calibration = problem.prior_mean

    def _start(self, problem: Problem, ids: Index, T_given: Array | None) -> tuple[Array, Mask]:
        """Poses (n, D, D) as known, carried on by odometry, given, or laid onto the map."""
        size = problem.tag_dof + 1
        T = np.full((len(ids), size, size), np.nan)
        T[np.isin(ids, self.ids)] = self.T.reshape(-1, size, size)[np.isin(self.ids, ids)]
        step = dict(zip((problem.odometry.first + 1).tolist(), problem.odometry.T, strict=True))
        for i in np.flatnonzero(np.isnan(T[:, 0, 0])).tolist():
            if i in step and np.isfinite(T[i - 1, 0, 0]):
                T[i] = T[i - 1] @ step[i]
            elif T_given is not None and np.isfinite(T_given[i, 0, 0]):
                T[i] = T_given[i]
            elif (found := self._laid_on_map(problem, i)) is not None:
                T[i] = found
        return T, np.isfinite(T[:, 0, 0])

    def _laid_on_map(self, problem: Problem, pose: int) -> Array | None:
        """T_map_base by what one pose sees of known tags; None if that does not determine it."""
        seen = _points(problem, [block.pose == pose for block in problem.sightings])
        known = np.isfinite(self.p[seen.tag, 0])
        if known.sum() < LEAST_SHARED:
            return None
        weights = np.trace(seen.information[known], axis1=1, axis2=2)
        fit = align(seen.p_base[known], self.p[seen.tag[known]], weights)
        return fit.T_b_a if fit.determined else None

    def _add_tags(self, problem: Problem, T: Array, placed: Mask) -> None:
        """Tags that placed poses see and nobody knew."""
        unknown = np.isnan(self.p[:, 0])
        new = [unknown[block.tag] & placed[block.pose] for block in problem.sightings]
        if any(part.any() for part in new):
            fit = fit_tags(_points(problem, new), T, problem.n_tags)
            self.p[fit.determined] = fit.p[fit.determined]

    def _condense(self, alive: Problem, optimum: Optimum, tags: Index) -> None:
        """The oldest poses of chains that have become too long."""
        old = _old(alive, self._span)
        if not old.any():
            return
        try:
            left, state = condense(alive, optimum, old)
        except np.linalg.LinAlgError:
            return
        assert left.condensed is not None
        self.condensed = left.condensed.among(tags, len(self.p))
        self._taken = tags, left.condensed
        self.ids, self.T = self.ids[~old], state.T


def _points(problem: Problem, which: list[Mask]) -> Points:
    """Of some of the sightings of each block."""
    pairs = zip(problem.sightings, which, strict=True)
    part = replace(
        problem, sightings=tuple(block.take(np.flatnonzero(keep)) for block, keep in pairs)
    )
    return points_of(without_calibration(part))


def _old(problem: Problem, span: Span) -> Mask:
    """Which poses go: whole lots of `at_once`, from the beginning of each chain."""
    breaks = np.ones(problem.n_poses, dtype=np.int64)
    breaks[problem.odometry.first + 1] = 0
    chain = np.cumsum(breaks) - 1
    starts = np.flatnonzero(breaks)
    length = np.diff(np.append(starts, problem.n_poses))
    going = np.maximum(length - span.alive, 0) // span.at_once * span.at_once
    place = np.arange(problem.n_poses) - starts[chain]
    old: Mask = place < going[chain]
    return old
