"""The joint problem linearised at some values of its unknowns.

        [ A  B ] [poses]     [ a ]      A  block tridiagonal, one chain of odometry after the other
        [ B' C ] [rest ]  =  [ b ]      rest: tags, then calibration unknowns

How a step is found is said in tagmap.estimation.reduced.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation import robust
from tagmap.estimation.kernels import calibration as unknowns
from tagmap.estimation.kernels import motion, sightings, steps
from tagmap.estimation.kernels.layout import Linear, Steps
from tagmap.estimation.levelling import is_held, level
from tagmap.estimation.packing import empty, pack, poses_in_space, state_of, tags_in_space
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.residuals import Residuals, Weights
from tagmap.estimation.shares import Share, Shares

_SUMS = (
    "tag_diagonal",
    "tag_gradient",
    "tag_calibration",
    "calibration",
    "calibration_gradient",
)


@dataclass(frozen=True, slots=True)
class Values:
    """Of the unknowns, in space: T (N, 4, 4), p (M, 3), calibration (Q,)."""

    T: Array
    p: Array
    calibration: Array


@dataclass(frozen=True, slots=True)
class Belief:
    """Robust weights of all sightings (K,), ascending by pose, surveyed tags and steps (N - 1,)."""

    sightings: Array
    surveyed: Array
    steps: Array


@dataclass(frozen=True, slots=True)
class Squares:
    """Squared whitened residuals: of sightings (K,), steps (N - 1,), surveyed tags, priors."""

    sightings: Array
    steps: Array
    surveyed: Array
    calibration: Array


@dataclass(frozen=True, slots=True)
class Point:
    """The problem at some values: its linear model, and what each factor costs there.

    The model stands until the system is linearised elsewhere: it has room for one.

    asked: the cost at the weights it was asked with; `belief`, `cost`: those of the model.
    own (M, 3, 3): what the tags' blocks hold besides sightings.
    """

    values: Values
    linear: Linear
    own: Array
    squares: Squares
    belief: Belief
    asked: float
    cost: float


class System:
    """The packed problem, and room for its linear model. threads: as many sweep along the poses."""

    def __init__(self, problem: Problem, threads: int = 1) -> None:
        self.problem = problem
        self.packed = pack(problem)
        self.n_columns = len(problem.calibration)
        self.shares = Shares(self.packed.first, self.packed.steps, threads)
        self._room = empty(self.packed, problem.n_tags, self.n_columns)
        self._room.following[self.shares.cuts] = 0.0
        self._apart = [
            {name: np.empty_like(sum_) for name, sum_ in _sums(self._room).items()}
            for _ in self.shares.all[1:]
        ]
        if problem.condensed is not None:
            pairs = problem.condensed
            self._own_pairs = np.flatnonzero(pairs.rows == pairs.columns)
        surveyed, d = problem.surveyed, problem.tag_dof
        self._survey = np.zeros((len(surveyed), 3, 3))
        self._survey[:, :d, :d] = np.swapaxes(surveyed.whiten, -1, -2) @ surveyed.whiten
        self._surveyed_p = tags_in_space(surveyed.p)

    def values(self, state: State) -> Values:
        return Values(poses_in_space(state.T), tags_in_space(state.p), state.calibration.copy())

    def state(self, values: Values) -> State:
        return state_of(self.problem.kind, values.T, values.p, values.calibration)

    def moved(self, values: Values, poses: Array, tags: Array, calibration: Array) -> Values:
        T = np.empty_like(values.T)
        motion.move_all(values.T, poses, T)
        return Values(T, values.p + tags, values.calibration + calibration)

    def belief(self, weights: Weights) -> Belief:
        """Weights by block as rows."""
        rows = np.ones(self.problem.n_sightings)
        for at, w in zip(self.packed.rows, weights.sightings, strict=True):
            rows[at] = w
        steps_ = np.ones(len(self.packed.steps.row))
        steps_[self.problem.odometry.first] = weights.odometry
        return Belief(rows, weights.surveyed, steps_)

    def weights(self, belief: Belief) -> Weights:
        """And back."""
        by_block = tuple(belief.sightings[rows] for rows in self.packed.rows)
        return Weights(by_block, belief.steps[self.problem.odometry.first], belief.surveyed)

    def residuals(self, squares: Squares) -> Residuals:
        """Squared residuals by block."""
        by_block = tuple(squares.sightings[rows] for rows in self.packed.rows)
        steps_ = squares.steps[self.problem.odometry.first]
        return Residuals(by_block, steps_, squares.surveyed, squares.calibration)

    def certain(self) -> Belief:
        """Everything is believed."""
        return Belief(
            np.ones(self.problem.n_sightings),
            np.ones(len(self.problem.surveyed)),
            np.ones(len(self.packed.steps.row)),
        )

    def at(
        self,
        values: Values,
        belief: Belief,
        mu: float = sightings.KEEP,
        survey_mu: float = sightings.KEEP,
        model: bool = True,
    ) -> Point:
        """Linearise, at new weights if mu is not KEEP; `asked` is the cost at the given ones.

        survey_mu: likewise of the surveyed tags.

        Without `model` the linear model is left undefined: only costs are found.
        """
        linear = self._room._replace(T=values.T, p=values.p)
        for sums in (_sums(linear), *self._apart):
            _clear(sums)
        linear.pose_calibration[:] = 0.0
        w, r2 = np.empty_like(belief.sightings), np.empty_like(belief.sightings)
        step_w, step_r2 = np.ones_like(belief.steps), np.zeros_like(belief.steps)
        steps_ = self._corrected(values)
        c2, least = robust.step_bound(self.problem.pose_dof), robust.LEAST_STEP

        def linearise(share: Share) -> list[float]:
            part, at = self._part(share, linear), share.steps
            of_sightings = sightings.linearise_sightings(
                self.packed.sighted, values.calibration, mu, belief.sightings, w, r2, model, part
            )
            of_steps = steps.linearise_steps(
                share.of_steps(steps_),
                mu,
                c2,
                least,
                belief.steps[at],
                step_w[at],
                step_r2[at],
                model,
                part,
            )
            return [of_sightings[0] + of_steps[0], of_sightings[1] + of_steps[1]]

        asked, cost = np.sum(self.shares.each(linearise), axis=0).tolist()
        for apart in self._apart:
            _add(apart, linear)
        if self._has_step_unknowns and model:
            unknowns.add_steps(self.packed.steps, steps_.T, step_w, values.calibration, linear)
        if self.packed.pose_pins.any():
            linear.diagonal[:, range(6), range(6)] += self.packed.pose_pins
        own, surveyed_w, surveyed_r2 = self._add_surveys(linear, values, belief.surveyed, survey_mu)
        prior_r2 = self._add_calibration_prior(linear, values)
        rest = float(prior_r2.sum()) + self._add_condensed(linear, values)
        return Point(
            values,
            linear,
            own,
            Squares(r2, step_r2, surveyed_r2, prior_r2),
            Belief(w, surveyed_w, step_w),
            asked + rest + float(belief.surveyed @ surveyed_r2),
            cost + rest + float(surveyed_w @ surveyed_r2),
        )

    def _part(self, share: Share, linear: Linear) -> Linear:
        """A share of it, with sums of its own unless it is the first."""
        part = share.of(linear)
        if share.number == 0:
            return part
        apart: dict[str, Any] = dict(self._apart[share.number - 1])
        return part._replace(**apart)

    @property
    def _has_step_unknowns(self) -> bool:
        return bool(self.packed.steps.columns.shape[1])

    def _corrected(self, values: Values) -> Steps:
        """Odometry as its own scales say, where they are unknowns."""
        measured = self.packed.steps
        if not self._has_step_unknowns:
            return measured
        corrected = measured._replace(T=np.empty_like(measured.T))
        unknowns.corrected_steps(measured, values.calibration, corrected.T)
        return corrected

    def _add_surveys(
        self, linear: Linear, values: Values, old: Array, mu: float
    ) -> tuple[Array, Array, Array]:
        """Their own blocks (M, 3, 3), weights and squared residuals."""
        tag = self.problem.surveyed.tag
        offset = values.p[tag] - self._surveyed_p
        pull = (self._survey @ offset[:, :, None])[:, :, 0]
        r2 = (offset * pull).sum(axis=1)
        w = old
        if mu >= 0.0:
            w = robust.truncated(r2, robust.chi2_bound(self.problem.tag_dof), mu)
        own = np.zeros_like(linear.tag_diagonal)
        own[:, range(3), range(3)] = self.packed.tag_pins
        np.add.at(own, tag, self._survey * w[:, None, None])
        np.add.at(linear.tag_gradient, tag, pull * w[:, None])
        linear.tag_diagonal[:] += own
        return own, w, r2

    def _add_condensed(self, linear: Linear, values: Values) -> float:
        """What keyframes that are gone said of tags and calibration."""
        condensed = self.problem.condensed
        if condensed is None:
            return 0.0
        if is_held(self.problem):
            here = level(condensed, self.problem.kind, values.p, values.calibration)
        else:
            here = condensed.about(values.p, values.calibration)
        linear.tag_gradient[:] += here.pull
        linear.calibration_gradient[:] += here.calibration_pull
        tags, _ = condensed.own
        linear.tag_diagonal[tags] += here.blocks[self._own_pairs]
        linear.tag_calibration[:] += here.across
        linear.calibration[:] += here.corner
        return here.cost

    def _add_calibration_prior(self, linear: Linear, values: Values) -> Array:
        information = self.problem.prior_sigma**-2.0
        offset = values.calibration - self.problem.prior_mean
        linear.calibration[range(self.n_columns), range(self.n_columns)] += information
        linear.calibration_gradient[:] += information * offset
        r2: Array = information * offset**2
        return r2


def _sums(linear: Linear) -> dict[str, Array]:
    """What is added to, not set, and not along the poses."""
    return {name: getattr(linear, name) for name in _SUMS}


def _clear(sums: dict[str, Array]) -> None:
    for sum_ in sums.values():
        sum_[:] = 0.0


def _add(sums: dict[str, Array], linear: Linear) -> None:
    for name, sum_ in sums.items():
        getattr(linear, name)[:] += sum_
