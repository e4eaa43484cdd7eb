"""Robust weights by graduated non-convexity: start convex, end with outliers switched off.

Geman-McClure loss rho(r2) = c2 r2 / (c2 + r2), made convex by a large mu and hardened step by step
(Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020, eq. 9-12):
    w = (mu c2 / (mu c2 + r2))^2,   mu -> 1
`c2` is a chi-square quantile of the factor's dimension, so it needs no tuning to a data set.
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from tagmap.conventions import Array
from tagmap.estimation.linearise import Residuals, Weights

INLIER_PROBABILITY = 0.99


@dataclass(frozen=True, slots=True)
class Bounds:
    """c2 of each block of sightings (one number each), of odometry steps, of surveyed tags."""

    sightings: tuple[float, ...]
    odometry: float
    surveyed: float


def chi2_bound(dimension: int, probability: float = INLIER_PROBABILITY) -> float:
    return float(stats.chi2.ppf(probability, dimension))


def weights(residuals: Residuals, bounds: Bounds, mu: float, mu_odometry: float) -> Weights:
    """Weights in (0, 1]; a factor that cannot be (residual inf) gets 0."""
    return Weights(
        tuple(
            geman_mcclure(r2, c2, mu)
            for r2, c2 in zip(residuals.sightings, bounds.sightings, strict=True)
        ),
        geman_mcclure(residuals.odometry, bounds.odometry, mu_odometry),
        geman_mcclure(residuals.surveyed, bounds.surveyed, mu),
    )


def geman_mcclure(r2: Array, c2: float, mu: float) -> Array:
    """w (K,) of squared residuals r2 (K,)."""
    w: Array = np.square(mu * c2 / (mu * c2 + r2))
    return w


def cost(residuals: Residuals, bounds: Bounds, mu: float, mu_odometry: float) -> float:
    """The robust objective sum of mu c2 r2 / (mu c2 + r2), plus the priors of the scales."""

    def loss(r2: Array, c2: float, mu: float) -> float:
        bounded = np.where(np.isinf(r2), mu * c2, mu * c2 * r2 / (mu * c2 + r2))
        return float(bounded.sum())

    seen = sum(
        loss(r2, c2, mu) for r2, c2 in zip(residuals.sightings, bounds.sightings, strict=True)
    )
    return (
        seen
        + loss(residuals.odometry, bounds.odometry, mu_odometry)
        + loss(residuals.surveyed, bounds.surveyed, mu)
        + float(residuals.scale.sum())
        + residuals.prior
    )


def first_mu(residuals: Residuals, bounds: Bounds, most: float) -> float:
    """mu at which the worst sighting still pulls: 2 max(r2) / c2, within [1, most]."""
    ratios = [
        float(np.max(r2[np.isfinite(r2)], initial=0.0)) / c2
        for r2, c2 in zip(residuals.sightings, bounds.sightings, strict=True)
    ]
    return float(np.clip(2.0 * max(ratios, default=0.0), 1.0, most))
