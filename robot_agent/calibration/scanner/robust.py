"""A fit that bad samples do not move, and which samples are bad."""

from dataclasses import dataclass, replace

import numpy as np

from robot_agent.calibration.scanner.fit import (
    PRIOR_SEPARATION_M,
    Fit,
    Noise,
    covariance_of,
    fit,
)
from robot_agent.calibration.scanner.samples import Samples
from robot_agent.calibration.scanner.start import place
from tagmap.conventions import Array, Mask
from tagmap.geometry.scanner.mirrors import Mirrors
from tagmap.geometry.scanner.scanner import MODELS, Scanner, point

MEDIAN_CHI2 = 2.0 * np.log(2.0)
"""Of two normal coordinates."""
SOFT_CHI2 = 6.0
"""Where a sample begins to lose its weight."""
BAD_CHI2 = 2.0 * np.log(1e4)
"""One good sample in 10 000 is farther off."""
ROUNDS = 10


@dataclass(frozen=True, slots=True)
class Judged:
    """A fit to `good` (N,) samples, how far off (N,) m each is from the beams of the others, and
    how far it may be."""

    fit: Fit
    good: Mask
    off_m: Array
    allowed_m: Array


def fit_good(model: str, samples: Samples, noise: Noise) -> Judged:
    """Raises DegenerateError where the samples do not even place the scanner."""
    found = _gradually(model, samples, noise)
    judged = _judge(found, samples, noise, None)
    for _ in range(ROUNDS):
        good = judged.good
        if 2 * good.sum() < len(samples):
            break
        found = fit(found.scanner, samples.only(good), noise)
        judged = _judge(found, samples, noise, good)
        if (judged.good == good).all():
            break
    return judged


def _gradually(model: str, samples: Samples, noise: Noise) -> Fit:
    """From the simplified model to the asked one; samples lose weight as they disagree."""
    separation_m = PRIOR_SEPARATION_M if MODELS[model] else 0.0
    scanner = Scanner(Mirrors(separation_m), place(samples), (), np.eye(6))
    for name in dict.fromkeys((("simplified" if MODELS[model] else model), model)):
        scanner = replace(scanner, free=MODELS[name])
        for _ in range(ROUNDS):
            chi2 = _chi2(scanner, samples, noise)
            weights = (1.0 + chi2 / (SOFT_CHI2 * _scale(chi2))) ** -2
            found = fit(scanner, samples, noise, weights)
            scanner = found.scanner
    return found


def _chi2(scanner: Scanner, samples: Samples, noise: Noise) -> Array:
    there = point(scanner, samples.theta, samples.p_cam)
    off = there.off[..., None]
    chi2: Array = (off * np.linalg.solve(covariance_of(there, noise), off)).sum(axis=(-1, -2))
    return chi2


def _scale(chi2: Array) -> float:
    """Squared excess over the stated noise, by the median; at least 1."""
    return float(np.maximum(1.0, np.median(chi2) / MEDIAN_CHI2))


def _judge(found: Fit, samples: Samples, noise: Noise, fitted: Mask | None) -> Judged:
    """Each sample against the fit of the others: one of `fitted` (N,) pulls the fit to itself,
    which its covariance tells; another has not. None: the fit was to all, in part."""
    there = point(found.scanner, samples.theta, samples.p_cam)
    spread = there.by_scanner @ found.scanner.cov @ np.swapaxes(there.by_scanner, -1, -2)
    sign = np.zeros(len(samples)) if fitted is None else np.where(fitted, -1.0, 1.0)
    cov = covariance_of(there, noise) + sign[:, None, None] * spread
    off = there.off[..., None]
    chi2 = (off * np.linalg.solve(cov, off)).sum(axis=(-1, -2))
    allowed = BAD_CHI2 * _scale(chi2 if fitted is None else chi2[fitted])
    off_m = np.sqrt((there.off**2).sum(axis=-1))
    good = (there.ahead > 0.0) & (chi2 <= allowed)
    return Judged(found, good, off_m, off_m * np.sqrt(allowed / chi2))
