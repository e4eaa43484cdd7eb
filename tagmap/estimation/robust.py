"""Robust weights by graduated non-convexity: begin with a convex cost, end with outliers cut off.

Truncated least squares, rho(r2) = min(r2, c2), approached through the surrogate of Yang, Antonante,
Tzoumas, Carlone, "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020 (eq. 14):

    w = 1                                  r2 <= c2 mu / (mu + 1)
        sqrt(c2 mu (mu + 1) / r2) - mu     between
        0                                  r2 >= c2 (mu + 1) / mu

for mu growing from nearly 0 (w ~ 1 / r, a convex cost) to SHARPEST, beyond which weights are 0 or
1: then the last steps converge quadratically.
`c2` is a chi-square quantile of the factor's dimension: nothing here is tuned to a data set.
Odometry steps are cut off too where they are far off (a wheel slips), but hold on by a thread: a
part of the chain that nothing else determines then follows its step, which so is met and believed.
"""

from functools import cache

import numpy as np
from scipy import special

from tagmap.conventions import Array
from tagmap.estimation.problem import Problem
from tagmap.estimation.residuals import Weights

INLIER_PROBABILITY = 0.99
SLIP_PROBABILITY = 1e-15
LEAST_STEP = 1e-6
SHARPEST = 100.0
BLUNT = 1.0
BLUNTEST = 1e-4
BLUNTEST_SURVEY = 1e-8
MOST = 0.95


@cache
def chi2_bound(dimension: int) -> float:
    """The c2 that INLIER_PROBABILITY of true measurements stay below."""
    return float(special.chdtri(dimension, 1.0 - INLIER_PROBABILITY))


@cache
def step_bound(dimension: int) -> float:
    """The c2 of odometry steps, about 9 sigma: what is above is a slip, no step of wide tails."""
    return float(special.chdtri(dimension, SLIP_PROBABILITY))


def truncated(r2: Array, c2: float, mu: float) -> Array:
    """w (K,) of squared residuals r2 (K,); r2 = inf gives 0."""
    if mu >= SHARPEST:
        return (r2 <= c2).astype(float)
    safe = np.maximum(r2, 1e-30)
    w: Array = np.clip(np.sqrt(c2 * mu * (mu + 1.0) / safe) - mu, 0.0, 1.0)
    return w


def first_mu(r2: Array, c2: Array, least: float = BLUNTEST) -> float:
    """mu at which the surrogate is convex for MOST residuals: c2 / (2 r2 - c2), at least `least`.

    Not for the worst: one wrong identity would make a good start begin all over again.
    """
    ratio = np.where(np.isfinite(r2), r2 / c2, np.inf)
    worst = float(np.quantile(ratio, MOST, method="higher")) if len(ratio) else 0.0
    return float(np.clip(1.0 / max(2.0 * worst - 1.0, 1e-9), least, BLUNT))


def efficient(problem: Problem, weights: Weights) -> Weights:
    """Weights that give the covariance of the optimum: cutting off true measurements costs some.

    An M-estimate of psi(r) = r [|r|^2 <= c2] has the covariance E[psi']^-1 E[psi^2] E[psi']^-1 of
    that without cutting (Huber, "Robust Statistics", 1981, 6.3). For Gaussian r of dimension d both
    expectations are P(chi2_d+2 <= c2), of which P(chi2_d <= c2) is in the accepted factors already.
    """
    blocks = zip(problem.sightings, weights.sightings, strict=True)
    return Weights(
        tuple(efficiency(block.z.shape[1]) * w for block, w in blocks),
        weights.odometry,
        efficiency(problem.tag_dof) * weights.surveyed,
    )


@cache
def efficiency(dimension: int) -> float:
    """What an accepted measurement of that dimension is worth."""
    kept = special.chdtr(dimension + 2, chi2_bound(dimension))
    return float(kept / INLIER_PROBABILITY)
