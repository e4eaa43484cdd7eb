"""Robust weights by graduated non-convexity: begin with a convex cost, end with outliers cut off.

Truncated least squares, rho(r2) = min(r2, c2), approached through the surrogate of Yang, Antonante,
Tzoumas, Carlone, "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020 (eq. 14):

    w = 1                                  r2 <= c2 mu / (mu + 1)
        sqrt(c2 mu (mu + 1) / r2) - mu     between
        0                                  r2 >= c2 (mu + 1) / mu

for mu growing from nearly 0 (all weights alike) to SHARPEST, beyond which weights are 0 or 1: then
the last steps converge quadratically and covariances need no correction.
`c2` is a chi-square quantile of the factor's dimension: nothing here is tuned to a data set.
Odometry is not down-weighted: a chain cut at one bad step would fall apart.
"""

import numpy as np
from scipy import stats

from tagmap.conventions import Array
from tagmap.estimation.linearise import Residuals, Weights
from tagmap.estimation.problem import Problem

INLIER_PROBABILITY = 0.99
SHARPEST = 100.0
BLUNTEST = 1e-4


def chi2_bound(dimension: int) -> float:
    """The c2 that INLIER_PROBABILITY of true measurements stay below."""
    return float(stats.chi2.ppf(INLIER_PROBABILITY, dimension))


def weights_at(problem: Problem, residuals: Residuals, mu: float) -> Weights:
    """Weights of sightings and surveyed tags, 0..1."""
    return Weights(
        tuple(
            truncated(r2, chi2_bound(block.z.shape[1]), mu)
            for block, r2 in zip(problem.sightings, residuals.sightings, strict=True)
        ),
        np.ones_like(residuals.odometry),
        truncated(residuals.surveyed, chi2_bound(problem.tag_dof), mu),
    )


def truncated(r2: Array, c2: float, mu: float) -> Array:
    """w (K,) of squared residuals r2 (K,); r2 = inf gives 0."""
    if mu >= SHARPEST:
        return (r2 <= c2).astype(float)
    safe = np.maximum(r2, 1e-30)
    w: Array = np.clip(np.sqrt(c2 * mu * (mu + 1.0) / safe) - mu, 0.0, 1.0)
    return w


def first_mu(problem: Problem, residuals: Residuals) -> float:
    """mu at which the surrogate is convex for the worst residual: c2 / (2 max r2 - c2)."""
    ratio = max(
        (
            float(np.max(r2[np.isfinite(r2)], initial=0.0)) / chi2_bound(block.z.shape[1])
            for block, r2 in zip(problem.sightings, residuals.sightings, strict=True)
        ),
        default=0.0,
    )
    return float(np.clip(1.0 / max(2.0 * ratio - 1.0, 1e-9), BLUNTEST, SHARPEST))


def weighted_cost(residuals: Residuals, weights: Weights) -> float:
    """Sum of w r2 over all factors, with the priors: what a step at fixed weights decreases."""
    pairs = [
        *zip(residuals.sightings, weights.sightings, strict=True),
        (residuals.odometry, weights.odometry),
        (residuals.surveyed, weights.surveyed),
    ]
    total = sum(float(w[w > 0.0] @ r2[w > 0.0]) for r2, w in pairs)
    return total + float(residuals.scale.sum()) + residuals.prior
