"""Levenberg-Marquardt with graduated robust weights over the joint problem."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from tagmap.conventions import Array
from tagmap.estimation import robust
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.linear import Factorisation, NormalEquations
from tagmap.estimation.linearise import Weights, linearise, squared_residuals, updated
from tagmap.estimation.problem import Problem, State

MU_STEP = 1.6
MU_MOST = 1e4
DAMPING_FIRST = 1e-6
DAMPING_LEAST = 1e-12
DAMPING_MOST = 1e8


@dataclass(frozen=True, slots=True)
class Options:
    """tolerance: predicted relative decrease of the cost at which the optimum is reached."""

    max_iterations: int = 100
    tolerance: float = 1e-9
    graduated: bool = True


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
    bounds = robust_bounds(problem)
    residuals = squared_residuals(problem, state)
    mu = robust.first_mu(residuals, bounds, MU_MOST) if options.graduated else 1.0
    damping = DAMPING_FIRST
    converged = False
    iterations = 0
    weights = robust.weights(residuals, bounds, mu, max(mu, 1.0))
    cost = robust.cost(residuals, bounds, mu, mu)
    equations = linearise(problem, state, weights)
    while iterations < options.max_iterations and not converged:
        iterations += 1
        step = _step(equations, damping, free_directions(problem, state))
        if step is None:
            damping = max(damping * 10.0, 1e-9)
            if damping > DAMPING_MOST:
                break
            continue
        poses, border, predicted = step
        trial = updated(problem, state, poses, border)
        residuals = squared_residuals(problem, trial)
        trial_cost = robust.cost(residuals, bounds, mu, mu)
        if not trial_cost <= cost * (1.0 + 1e-12):
            damping = max(damping * 10.0, 1e-9)
            if damping > DAMPING_MOST:
                break
            if predicted <= options.tolerance * max(cost, 1.0) and mu == 1.0:
                converged = True
            continue
        state, damping = trial, max(damping * 0.1, DAMPING_LEAST)
        converged = mu == 1.0 and predicted <= options.tolerance * max(cost, 1.0)
        mu = max(mu / MU_STEP, 1.0)
        weights = robust.weights(residuals, bounds, mu, mu)
        cost = robust.cost(residuals, bounds, mu, mu)
        equations = linearise(problem, state, weights)
    return Optimum(state, weights, equations, cost, iterations, converged)


def robust_bounds(problem: Problem) -> robust.Bounds:
    return robust.Bounds(
        tuple(robust.chi2_bound(block.z.shape[1]) for block in problem.sightings),
        robust.chi2_bound(problem.pose_dof),
        robust.chi2_bound(problem.tag_dof),
    )


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
