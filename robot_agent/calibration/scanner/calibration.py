"""Where a scanner aims, from samples: bad ones are found, and the error is that of samples held
out."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robot_agent.calibration.scanner.fit import Noise, covariance_of, fit
from robot_agent.calibration.scanner.robust import Judged, fit_good
from robot_agent.calibration.scanner.samples import Samples, read_samples
from tagmap.conventions import Array, Index
from tagmap.errors import DataError, DegenerateError
from tagmap.geometry.scanner.scanner import MODELS, Scanner, point

FEWEST = {"pinhole": 5, "simplified": 6, "full": 10}
"""Good samples: two equations each for 6, 7 and 12 unknowns, and some to find bad ones with."""
FEW, ADVISED = 20, 30
GOOD_SHARE = 2.0 / 3.0
FOLDS = 5
SEED = 1
EXCESSIVE = 1.5
"""Residuals by the stated noise, from which on something is wrong with either."""
ALIKE = 1.3
"""Ratio of far to near range, below which the aim at other ranges is open."""
LOOSE_AIM_M = 0.005


@dataclass(frozen=True, slots=True)
class HeldOut:
    """RMS over n samples, about range_m away, of which each was predicted from others: how far off
    they were, how far they should have been by the stated noise, and how much of that is aim."""

    n: int
    range_m: float
    off_m: float
    expected_m: float
    aim_m: float


@dataclass(frozen=True, slots=True)
class AimCalibration:
    """A scanner with its covariance, `excess` by which residuals exceed the stated noise (the
    covariance is scaled by its square if it is above 1), and how far off held-out samples are."""

    model: str
    scanner: Scanner
    samples: Samples
    noise: Noise
    judged: Judged
    excess: float
    near: HeldOut
    far: HeldOut
    notes: list[str]

    @property
    def rms_m(self) -> float:
        """Of the good samples, RMS distance from their beams."""
        off = self.judged.off_m[self.judged.good]
        return float(np.sqrt(np.mean(off**2)))

    @property
    def bad(self) -> list[tuple[int, str]]:
        """Lines of bad samples, each with the reason."""
        where = np.flatnonzero(~self.judged.good)
        return [(int(self.samples.lines[i]), _reason(self.judged, int(i))) for i in where]


def calibrate(model: str, samples: Samples, noise: Noise) -> AimCalibration:
    """Model: of MODELS. Raises DataError with too few good samples, DegenerateError where they
    leave something open."""
    _require_enough(model, len(samples), "")
    judged = fit_good(model, samples, noise)
    _require_good(model, samples, judged)
    kept = samples.only(judged.good)
    excess = _excess(judged.fit.scanner, kept, noise)
    cov = judged.fit.scanner.cov * max(1.0, excess) ** 2
    scanner = replace(judged.fit.scanner, cov=cov)
    near, far = _held_out(scanner, kept, noise, excess)
    notes = list(_notes(model, judged, excess, near, far))
    return AimCalibration(model, scanner, samples, noise, judged, excess, near, far, notes)


def _require_enough(model: str, n: int, left_out: str) -> None:
    fewest = FEWEST[model]
    if n < fewest:
        unknowns = 6 + len(MODELS[model])
        raise DataError(
            f"{n} good samples, expected at least {fewest} for the {unknowns} unknowns of the"
            f" {model} model, better {ADVISED}{left_out}"
        )


def _require_good(model: str, samples: Samples, judged: Judged) -> None:
    good = int(judged.good.sum())
    named = [
        f"line {samples.lines[i]} {_reason(judged, int(i))}" for i in np.flatnonzero(~judged.good)
    ]
    left_out = f"; left out {'; '.join(named[:5])}" if named else ""
    _require_enough(model, good, left_out)
    if good < GOOD_SHARE * len(samples):
        raise DataError(
            f"{good} of {len(samples)} samples agree on a scanner, expected at least two thirds;"
            " are theta1_rad, theta2_rad the angles of mirrors X, Y, not of the beam, does one of"
            " them count the other way, are targets in m in cam?"
        )


def _reason(judged: Judged, i: int) -> str:
    off_mm, allowed_mm = 1e3 * judged.off_m[i], 1e3 * judged.allowed_m[i]
    return f"is {off_mm:.1f} mm off, expected at most {allowed_mm:.1f} mm"


def _excess(scanner: Scanner, samples: Samples, noise: Noise) -> float:
    """Root of chi2 by its degrees of freedom."""
    there = point(scanner, samples.theta, samples.p_cam)
    off = there.off[..., None]
    chi2 = float((off * np.linalg.solve(covariance_of(there, noise), off)).sum())
    return float(np.sqrt(chi2 / (2 * len(samples) - len(scanner.cov))))


def _held_out(
    scanner: Scanner, samples: Samples, noise: Noise, excess: float
) -> tuple[HeldOut, HeldOut]:
    """The nearer and the farther half: every sample by a fit to the other folds."""
    n = len(samples)
    off2, expected2, aim2 = np.empty(n), np.empty(n), np.empty(n)
    fold = np.random.default_rng(SEED).permutation(n) % FOLDS
    for k in range(FOLDS):
        out = fold == k
        others = fit(scanner, samples.only(~out), noise).scanner
        there = point(others, samples.theta[out], samples.p_cam[out])
        spread = there.by_scanner @ others.cov @ np.swapaxes(there.by_scanner, -1, -2)
        scale = max(1.0, excess) ** 2
        off2[out] = (there.off**2).sum(axis=-1)
        aim2[out] = scale * _trace(spread)
        expected2[out] = _trace(spread) + _trace(covariance_of(there, noise))
    range_m = np.sqrt((samples.p_cam**2).sum(axis=-1))
    order = np.argsort(range_m)

    def half(which: Index) -> HeldOut:
        rms = (float(np.sqrt(np.mean(values[which]))) for values in (off2, expected2, aim2))
        return HeldOut(len(which), float(np.mean(range_m[which])), *rms)

    return half(order[: n // 2]), half(order[n // 2 :])


def _trace(cov: Array) -> Array:
    trace: Array = np.trace(cov, axis1=-2, axis2=-1)
    return trace


def _notes(model: str, judged: Judged, excess: float, near: HeldOut, far: HeldOut) -> Iterator[str]:
    good = int(judged.good.sum())
    if not judged.fit.converged:
        yield "the fit has not converged: take more samples, spread over the view"
    if excess > EXCESSIVE:
        hint = ": try --model full" if model == "simplified" else ""
        yield f"residuals are {excess:.1f} times the stated noise{hint}"
    if good < FEW:
        yield f"{good} good samples, {ADVISED} on a grid at two ranges aim well"
    if far.range_m < ALIKE * near.range_m:
        yield (
            f"all targets are about {near.range_m:.1f} to {far.range_m:.1f} m away: the aim at"
            " other ranges is open, add targets at half and double the range"
        )
    for name, half in (("near", near), ("far", far)):
        if half.aim_m > LOOSE_AIM_M and excess <= EXCESSIVE:
            yield f"aim {name}, at {half.range_m:.1f} m, is known to {1e3 * half.aim_m:.1f} mm only"


def calibrate_file(model: str, path: Path, noise: Noise) -> AimCalibration:
    """Of a file of samples; errors name it. Raises DataError and DegenerateError."""
    samples = read_samples(path)
    try:
        return calibrate(model, samples, noise)
    except (DataError, DegenerateError) as error:
        raise type(error)(f"{path}: {error}") from None
