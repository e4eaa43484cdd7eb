"""The most likely scanner for given samples: weighted least squares over SE(3) and the mirrors.

A sample says that a beam met a target: two equations, off(theta, p) = 0 across the beam. Both its
sides are measured, so their noise goes through the equations (errors in variables):

    C = J_theta J_theta^T sigma_theta^2 + I sigma_point^2       chi2 = sum off^T C^-1 off

which is as good as the Cramer-Rao bound, without unknown true targets. Far samples weigh less:
0.3 mrad of a mirror are 4.2 mm at 7 m.

Single parameters of the mirrors are weakly determined while the aim is good. So the parameters
have priors, as wide as what is built: where samples determine them, they do not matter.
"""

from dataclasses import dataclass, replace

import numpy as np

from robot_agent.calibration.scanner.samples import Samples
from tagmap.conventions import Array
from tagmap.errors import DegenerateError
from tagmap.geometry.scanner.mirrors import PARAMETERS
from tagmap.geometry.scanner.scanner import Pointing, Scanner, point

STEPS = 60
CONVERGED = 1e-9
"""Relative fall of the cost."""
SINGULAR = 1e-14
PRIOR_SIGMA = dict(zip(PARAMETERS, (0.1, 0.1, 0.0, 0.0, 0.02, 0.02, 0.2, 0.2), strict=True))
"""In m and rad, about an ideal scanner with axes PRIOR_SEPARATION_M apart."""
PRIOR_SEPARATION_M = 0.02


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of a sample: of each mirror angle, of each coordinate of the target."""

    theta_rad: float
    point_m: float


@dataclass(frozen=True, slots=True)
class Fit:
    """A scanner with the covariance that the noise implies; `converged` or out of steps."""

    scanner: Scanner
    converged: bool


def covariance_of(there: Pointing, noise: Noise) -> Array:
    """C (..., 2, 2) of off by the noise of the samples."""
    by_theta = noise.theta_rad * there.by_theta
    cov: Array = by_theta @ np.swapaxes(by_theta, -1, -2) + noise.point_m**2 * np.eye(2)
    return cov


def fit(start: Scanner, samples: Samples, noise: Noise, weights: Array | None = None) -> Fit:
    """Levenberg-Marquardt from `start`, which also says which parameters are free.

    weights (N,) of the samples, 1 where not given. Raises DegenerateError.
    """
    scanner, damping, converged = start, 1e-6, False
    cost, H, g = _normal(scanner, samples, noise, weights)
    for _ in range(STEPS):
        scale = np.sqrt(np.diag(H))
        normed = H / np.outer(scale, scale) + damping * np.eye(len(H))
        delta = -np.linalg.solve(normed, g / scale) / scale
        tried = scanner.moved(delta)
        new_cost, new_H, new_g = _normal(tried, samples, noise, weights)
        if not new_cost <= cost * (1.0 + 1e-12):
            damping *= 10.0
            converged = damping > 1e8
        else:
            converged = cost - new_cost <= CONVERGED * cost
            scanner, cost, H, g, damping = tried, new_cost, new_H, new_g, 0.1 * damping
        if converged:
            break
    return Fit(replace(scanner, cov=_inverse(H)), converged)


def _normal(
    scanner: Scanner, samples: Samples, noise: Noise, weights: Array | None
) -> tuple[float, Array, Array]:
    """Cost, H (6 + n, 6 + n) and gradient (6 + n,); an infinite cost where a beam fails."""
    there = point(scanner, samples.theta, samples.p_cam)
    H, g, cost = _prior(scanner)
    if not np.isfinite(there.off).all():
        return np.inf, H, g
    L = np.linalg.cholesky(covariance_of(there, noise))
    J = np.linalg.solve(L, there.by_scanner)
    r = np.linalg.solve(L, there.off[..., None])[..., 0]
    w = np.ones(len(r)) if weights is None else weights
    H = H + np.einsum("n,nki,nkj->ij", w, J, J)
    return cost + float(w @ (r * r).sum(axis=-1)), H, g + np.einsum("n,nki,nk->i", w, J, r)


def _inverse(H: Array) -> Array:
    scale = np.sqrt(np.diag(H))
    values, vectors = np.linalg.eigh(H / np.outer(scale, scale))
    if not values[0] > SINGULAR:
        raise DegenerateError(
            "the samples leave a parameter open: spread the targets over the view"
        )
    cov: Array = (vectors / values) @ vectors.T / np.outer(scale, scale)
    return cov


def _prior(scanner: Scanner) -> tuple[Array, Array, float]:
    n = 6 + len(scanner.free)
    information, gradient, cost = np.zeros(n), np.zeros(n), 0.0
    for k, name in enumerate(scanner.free, start=6):
        centre = PRIOR_SEPARATION_M if name == "separation_m" else 0.0
        information[k] = PRIOR_SIGMA[name] ** -2
        gradient[k] = information[k] * (getattr(scanner.mirrors, name) - centre)
        cost += gradient[k] ** 2 / information[k]
    return np.diag(information), gradient, cost
