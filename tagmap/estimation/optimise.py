"""Levenberg-Marquardt on the joint problem, with robust weights that sharpen as it goes."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from tagmap.conventions import Array
from tagmap.estimation import robust
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.linear import Factorisation, NormalEquations
from tagmap.estimation.linearise import linearise, updated
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.residuals import Residuals, Weights, squared_residuals, weighted_cost

# While steps still gain more than this part of the cost, the weights wait: sharpened early, they
# would cut off what the state has yet to come near.
SHARPEN_BELOW = 0.1
DAMPING_FIRST = 1e-6
DAMPING_LEAST = 1e-12
DAMPING_MOST = 1e8


@dataclass(frozen=True, slots=True)
class Options:
    """tolerance: predicted relative decrease of the cost at which the optimum is reached.

    mu_step: factor by which the robust weights sharpen at a time.
    max_regroupings: how often a sighting may still change between inlier and outlier once the
    weights are sharp; then the last choice stands.
    """

    max_iterations: int = 200
    tolerance: float = 1e-10
    mu_step: float = 2.0
    max_regroupings: int = 20


@dataclass(frozen=True, slots=True)
class Optimum:
    """The minimum found and how it was reached; `equations` are those at the minimum."""

    state: State
    weights: Weights
    equations: NormalEquations
    cost: float
    iterations: int
    converged: bool


def optimise(problem: Problem, state: State, options: Options) -> Optimum:
    """Minimise the robust cost from `state`; a free gauge stays where `state` has it."""
    residuals = squared_residuals(problem, state)
    mu = robust.first_mu(problem, residuals)
    weights = robust.weights_at(problem, residuals, mu)
    damping = DAMPING_FIRST
    regroupings = iterations = 0
    equations = linearise(problem, state, weights)
    settled = False
    while iterations < options.max_iterations and not settled:
        iterations += 1
        moved = _descend(problem, state, residuals, weights, equations, damping, options.tolerance)
        if moved is None:
            break
        state, residuals, damping, decrease = moved
        sharp = mu >= robust.SHARPEST
        converged = sharp and decrease <= options.tolerance
        if decrease <= SHARPEN_BELOW:
            mu = min(mu * options.mu_step, robust.SHARPEST)
        if regroupings < options.max_regroupings:
            new = robust.weights_at(problem, residuals, mu)
            regrouped = sharp and not _same(new, weights)
            regroupings += regrouped
            weights = new
            settled = converged and not regrouped
        else:
            settled = converged
        equations = linearise(problem, state, weights)
    cost = weighted_cost(residuals, weights)
    return Optimum(state, weights, equations, cost, iterations, settled)


def _same(a: Weights, b: Weights) -> bool:
    blocks = zip(a.sightings, b.sightings, strict=True)
    return all(np.array_equal(x, y) for x, y in blocks) and np.array_equal(a.surveyed, b.surveyed)


def _descend(
    problem: Problem,
    state: State,
    residuals: Residuals,
    weights: Weights,
    equations: NormalEquations,
    damping: float,
    tolerance: float,
) -> tuple[State, Residuals, float, float] | None:
    """One accepted step: new state, its residuals, next damping, predicted relative decrease.

    At the optimum, where nothing of the `tolerance` is left to gain, the state
    stays. None if no damping helps.
    """
    cost = weighted_cost(residuals, weights)
    gauge = free_directions(problem, state)
    while damping <= DAMPING_MOST:
        step = _step(equations, damping, gauge)
        if step is not None:
            poses, border, predicted = step
            trial = updated(problem, state, poses, border)
            trial_residuals = squared_residuals(problem, trial)
            decrease = predicted / max(cost, 1.0)
            if weighted_cost(trial_residuals, weights) <= cost:
                return trial, trial_residuals, max(damping * 0.1, DAMPING_LEAST), decrease
            if decrease <= tolerance:
                return state, residuals, damping, decrease
        damping = max(damping * 10.0, 1e-9)
    return None


def _step(
    equations: NormalEquations, damping: float, gauge: Array | None
) -> tuple[Array, Array, float] | None:
    """Step and the decrease of the cost that the linear model predicts; None if not solvable."""
    try:
        poses, border = Factorisation(equations, damping, gauge).step()
    except linalg.LinAlgError:
        return None
    predicted = -float(np.vdot(poses, equations.gradient_pose))
    predicted -= float(border @ equations.gradient_border)
    return poses, border, predicted
