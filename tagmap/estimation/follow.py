"""Where all poses are once the tags are known: each chain follows, by itself.

Poses that were condensed stay where they were then; the map has learnt since. With tags and
calibration held a chain is one block tridiagonal system, solved in one sweep.
"""

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.kernels import chain
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.residuals import Weights
from tagmap.estimation.system import Point, System

MOST_SWEEPS = 20
DAMPING_FIRST, DAMPING_LEAST = 1e-9, 1e-12


def followed(
    problem: Problem, state: State, weights: Weights | None = None, tolerance: float = 1e-6
) -> State:
    """`state` with its poses at the least squares of all factors at fixed weights (1 by default).

    tolerance: predicted decrease, by the cost, at which they are there.
    """
    system = System(problem)
    belief = system.certain() if weights is None else system.belief(weights)
    point, damping = system.at(system.values(state), belief), DAMPING_FIRST
    for _ in range(MOST_SWEEPS):
        step = _step(point, damping)
        if step is not None:
            if -float(np.vdot(step, point.linear.pose_gradient)) <= tolerance * point.cost:
                break
            values = point.values
            still, same = np.zeros_like(values.p), np.zeros_like(values.calibration)
            trial = system.at(system.moved(values, step, still, same), belief)
            if trial.asked <= point.cost:
                point, damping = trial, max(0.1 * damping, DAMPING_LEAST)
                continue
            point = system.at(point.values, belief)
        damping *= 10.0
    return system.state(point.values)


def _step(point: Point, damping: float) -> Array | None:
    """What the poses (N, 6) ask for; None where nothing determines them."""
    linear = point.linear
    L, D = np.zeros_like(linear.diagonal), np.zeros_like(linear.diagonal)
    step: Array = -linear.pose_gradient
    if not chain.factor(linear, damping, L, D, np.zeros((6, 6))):
        return None
    chain.solve(L, D, step)
    return step
