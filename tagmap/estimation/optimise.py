"""Levenberg-Marquardt on the joint problem, with robust weights that sharpen as it goes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation import robust
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.kernels.sightings import KEEP, PLAIN
from tagmap.estimation.preconditioner import Precondition
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.reduced import LEFT_OVER, Reduced, Step
from tagmap.estimation.residuals import Residuals, Weights
from tagmap.estimation.system import Belief, Point, System

# While steps still gain more than this part of the cost, the weights wait: sharpened early, they
# would cut off what the state has yet to come near.
SHARPEN_BELOW = 0.1
DAMPING_FIRST = 1e-6
DAMPING_LEAST = 1e-12
DAMPING_MOST = 1e8
MANY_PRODUCTS = 25
# Gauss-Newton steps shrink ever faster, but for what conjugate gradients leave: with margins.
MORE, SURE = 10.0, 0.1
# Of what may be left in all: a preconditioner of another point judges what is left by too little.
# What nobody confirms may be left to the next solve of a map that lives on.
LEFT_BY_STEP, LEFT_UNCONFIRMED = 0.01, 0.1


@dataclass(frozen=True, slots=True)
class Options:
    """tolerance: predicted relative decrease of the cost at which the optimum is reached.

    mu_step: factor by which the robust weights sharpen at a time; robust: whether there are any;
    first_mu: where they begin, None: as blunt as the start is bad; robust.SHARPEST where the state
    is the optimum of nearly the same problem.
    renewals: of the preconditioner, at the first steps. confirm: a further step must show that
    there is nothing left to gain; otherwise it is enough that the last one did what it promised.
    threads: that sweep along the poses, each along whole chains.
    max_regroupings: how often a sighting may still change between inlier and outlier once the
    weights are sharp; then the last choice stands.
    """

    max_iterations: int = 200
    tolerance: float = 1e-10
    mu_step: float = 4.0
    max_regroupings: int = 20
    robust: bool = True
    first_mu: float | None = None
    renewals: int = 1
    confirm: bool = True
    threads: int = 1


@dataclass(frozen=True, slots=True)
class Optimum:
    """The minimum found and how it was reached."""

    state: State
    weights: Weights
    residuals: Residuals
    cost: float
    iterations: int
    converged: bool


def optimise(problem: Problem, state: State, options: Options) -> Optimum:
    """Minimise the robust cost from `state`; a free gauge stays where `state` has it."""
    return Optimiser(problem, options).run(state)


class Optimiser:
    """One run over one problem; `products`: with S, in all."""

    def __init__(
        self,
        problem: Problem,
        options: Options,
        precondition: Callable[[Point], Precondition | None] | None = None,
    ) -> None:
        """precondition: asked before every step for one that is kept from a similar problem."""
        self._problem, self._options = problem, options
        self._system = System(problem, options.threads)
        self._reduced = Reduced(self._system)
        self._precondition = precondition
        self._damping = DAMPING_FIRST
        self._mu = self._survey_mu = KEEP if options.robust else PLAIN
        self._regroupings = 0
        self._renewals = 0
        self._products = 0
        self._gained = 0.0
        self.products = 0

    def run(self, state: State) -> Optimum:
        point = self._first(state)
        iterations, settled = 0, False
        while iterations < self._options.max_iterations and not settled:
            iterations += 1
            moved = self._descend(point)
            if moved is None:
                break
            point, settled = moved
        return Optimum(
            self._system.state(point.values),
            self._system.weights(point.belief),
            self._system.residuals(point.squares),
            point.cost,
            iterations,
            settled and not self._lacks(point),
        )

    def _lacks(self, point: Point) -> bool:
        """Whether least squares ended without some of its sightings: tags behind their cameras."""
        return self._mu == PLAIN and not point.belief.sightings.all()

    def _first(self, state: State) -> Point:
        values = self._system.values(state)
        point = self._system.at(values, self._system.certain())
        if not self._options.robust:
            return point
        sighted = self._system.packed.sighted
        c2 = sighted.c2[sighted.block[sighted.how]]
        given = self._options.first_mu
        self._mu = robust.first_mu(point.squares.sightings, c2) if given is None else given
        self._survey_mu = self._first_survey_mu(point.squares.surveyed)
        return self._system.at(values, point.belief, *self._kernel_mus())

    def _first_survey_mu(self, r2: Array) -> float:
        """A map that has not met its survey yet is as far from it as it is wrong itself.

        That is many sigmas of a good survey, which would be cut off before the map can give way.
        """
        if self._mu >= robust.SHARPEST:
            return self._mu
        c2 = np.full(len(r2), robust.chi2_bound(self._problem.tag_dof))
        return min(self._mu, robust.first_mu(r2, c2, robust.BLUNTEST_SURVEY))

    @property
    def _sharp(self) -> bool:
        return self._mu < 0.0 or self._mu >= robust.SHARPEST

    def _kernel_mus(self) -> tuple[float, float]:
        """Of sightings and steps, and of surveys. To kernels the sharpest weights are 0 or 1."""
        mu, survey_mu = (
            np.inf if mu >= robust.SHARPEST else mu for mu in (self._mu, self._survey_mu)
        )
        return mu, survey_mu

    def _descend(self, point: Point) -> tuple[Point, bool] | None:
        """One accepted step, and whether it was the last; None if no damping helps."""
        gauge = self._gauge(point)
        while self._damping <= DAMPING_MOST:
            if self._prepare(point, gauge):
                gain = self._options.tolerance * max(point.cost, 1.0)
                if self._sharp and self._reduced.bound() <= gain:
                    return point, True
                left = LEFT_BY_STEP if self._options.confirm else LEFT_UNCONFIRMED
                step = self._reduced.step(left * gain)
                self._products = step.products
                self.products += step.products
                if self._sharp and step.predicted <= gain:
                    return point, True
                last = self._leaves(step) <= SURE * gain
                trial = self._try(point, step, not last)
                if trial.asked <= point.cost:
                    sure = last or (self._sharp and not self._options.confirm)
                    if sure and _as_predicted(point, trial, step, gain):
                        return trial, True
                    if last:
                        trial = self._system.at(trial.values, trial.belief)
                    self._damping = max(self._damping * 0.1, DAMPING_LEAST)
                    self._count_regrouping(point, trial)
                    self._gained = step.predicted
                    return trial, False
                point = self._system.at(point.values, point.belief)
                self._gained = 0.0
            self._damping = max(self._damping * 10.0, 1e-9)
        return None

    def _prepare(self, point: Point, gauge: Array | None) -> bool:
        kept = None if self._precondition is None else self._precondition(point)
        if kept is not None:
            self._reduced.precondition = kept
            return self._reduced.prepare(point, self._damping, False, gauge)
        few = self._renewals < self._options.renewals
        renew = few or self._products > MANY_PRODUCTS
        self._renewals += renew
        return self._reduced.prepare(point, self._damping, renew, gauge)

    def _leaves(self, step: Step) -> float:
        """What the step after this one may gain, as fast as steps shrink: inf where unknown."""
        if not self._sharp or self._gained <= step.predicted:
            return np.inf
        return step.predicted * max(step.predicted / self._gained, MORE * LEFT_OVER)

    def _try(self, point: Point, step: Step, model: bool) -> Point:
        if step.predicted <= SHARPEN_BELOW * max(point.cost, 1.0) and self._mu > 0.0:
            self._sharpen(point.belief)
        values = self._system.moved(point.values, step.poses, step.tags, step.calibration)
        return self._system.at(values, point.belief, *self._kernel_mus(), model)

    def _sharpen(self, belief: Belief) -> None:
        """Where every factor is in or out already, sharper weights are the same ones."""
        if _is_decided(belief):
            self._mu = self._survey_mu = robust.SHARPEST
        elif self._survey_mu < self._mu:
            self._survey_mu = min(self._survey_mu * self._options.mu_step, self._mu)
        else:
            self._mu = min(self._mu * self._options.mu_step, robust.SHARPEST)
            self._survey_mu = self._mu

    def _count_regrouping(self, point: Point, trial: Point) -> None:
        if self._mu < 0.0 or not self._sharp:
            return
        self._regroupings += not _same(point.belief, trial.belief)
        if self._regroupings >= self._options.max_regroupings:
            self._mu = self._survey_mu = KEEP

    def _gauge(self, point: Point) -> Array | None:
        return free_directions(self._problem, point.values.p)


def _as_predicted(point: Point, trial: Point, step: Step, gain: float) -> bool:
    """Whether the model was right: no weight changed, and the cost fell as it said."""
    wrong = abs(point.cost - trial.cost - step.predicted)
    return wrong <= gain and _same(point.belief, trial.belief)


def _same(a: Belief, b: Belief) -> bool:
    pairs = (a.sightings, b.sightings), (a.surveyed, b.surveyed), (a.steps, b.steps)
    return all(np.array_equal(x, y) for x, y in pairs)


def _is_decided(belief: Belief) -> bool:
    weights = np.concatenate([belief.sightings, belief.surveyed, belief.steps])
    return bool(((weights == 1.0) | (weights <= robust.LEAST_STEP)).all())
