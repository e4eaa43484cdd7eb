"""How far each factor is from being met, and how much each is believed."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.factors import (
    odometry_residual,
    prior_difference,
    scale_residual,
    sighting_residual,
    surveyed_residual,
)
from tagmap.estimation.problem import Problem, State


@dataclass(frozen=True, slots=True)
class Residuals:
    """Squared whitened residuals per factor: one (K,) per block of sightings, then the others."""

    sightings: tuple[Array, ...]
    odometry: Array
    surveyed: Array
    scale: Array
    prior: float


@dataclass(frozen=True, slots=True)
class Weights:
    """Robust weight of each factor, 0..1, in the order of Residuals."""

    sightings: tuple[Array, ...]
    odometry: Array
    surveyed: Array


def squared_residuals(problem: Problem, state: State) -> Residuals:
    """NaN of a sighting that cannot be (a tag behind the camera) becomes inf."""
    kind = problem.kind
    seen = [_square(sighting_residual(kind, block, state)) for block in problem.sightings]
    return Residuals(
        sightings=tuple(np.where(np.isnan(r2), np.inf, r2) for r2 in seen),
        odometry=_square(odometry_residual(kind, problem.odometry, state)),
        surveyed=_square(surveyed_residual(problem.surveyed, state)),
        scale=scale_residual(problem, state) ** 2,
        prior=_prior_square(problem, state),
    )


def weighted_cost(residuals: Residuals, weights: Weights) -> float:
    """Sum of w r2 over all factors, with the priors: what a step at fixed weights decreases."""
    pairs = [
        *zip(residuals.sightings, weights.sightings, strict=True),
        (residuals.odometry, weights.odometry),
        (residuals.surveyed, weights.surveyed),
    ]
    total = sum(float(w @ np.where(w > 0.0, r2, 0.0)) for r2, w in pairs)
    return total + float(residuals.scale.sum()) + residuals.prior


def _square(r: Array) -> Array:
    squared: Array = np.einsum("ka,ka->k", r, r)
    return squared


def _prior_square(problem: Problem, state: State) -> float:
    if problem.prior is None:
        return 0.0
    difference = prior_difference(problem.kind, problem.prior, state)
    return float(difference @ problem.prior.information @ difference)
