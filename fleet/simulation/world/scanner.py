"""A robot's laser scanner: as it is, and as its owner calibrated it."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from fleet.simulation.scanning import NOISE, built, sampled
from fleet.simulation.world.chances import stream
from robot_agent.calibration.scanner.fit import fit
from robot_agent.calibration.scanner.start import place
from tagmap.conventions import Array
from tagmap.geometry.scanner.mirrors import Mirrors
from tagmap.geometry.scanner.scanner import MODELS, Scanner
from tagmap.records.arrays import mirror_record, transform, upper
from tagmap.records.scanner import ScannerCalibration

SLOPES = np.linspace(-0.5, 0.5, 5)
DEPTHS_M = (2.0, 6.0)
"""Targets of the calibration: over what the mirrors reach, at two depths."""
SEPARATION_M = 0.02
TINY = 1e-6
"""A deviation, in m and rad, where there is none: a covariance must be positive."""


@lru_cache(maxsize=64)
def calibrated(seed: int, name: str) -> tuple[Scanner, ScannerCalibration]:
    """From simulated samples of the true one, none of them bad: the fit alone, without the search
    for bad ones that `robot-agent calibrate scanner` begins with."""
    rng = stream(seed, "scanner", name)
    truth, model = built(rng), "simplified"
    samples = sampled(truth, targets(), rng)
    found = Scanner(Mirrors(SEPARATION_M), place(samples), MODELS[model], np.eye(7))
    for model in ("simplified", "full"):
        found = fit(replace(found, free=MODELS[model]), samples, NOISE).scanner
    return truth, _record(found, len(samples))


def exact(seed: int, name: str) -> tuple[Scanner, ScannerCalibration]:
    """One that is known exactly."""
    truth = built(stream(seed, "scanner", name))
    n = 6 + len(truth.free)
    return truth, _record(replace(truth, cov=TINY**2 * np.eye(n)), 0)


def targets() -> Array:
    """(50, 3) in cam."""
    x, y = np.meshgrid(SLOPES, SLOPES)
    rays = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    return np.concatenate([depth * rays for depth in DEPTHS_M])


def _record(scanner: Scanner, samples: int) -> ScannerCalibration:
    return ScannerCalibration(
        model="full",
        by="simulation",
        samples=samples,
        sigma_theta_rad=NOISE.theta_rad,
        sigma_point_m=NOISE.point_m,
        cov=upper(scanner.cov),
        T_cam_laser=transform(scanner.T_cam_laser),
        mirrors=mirror_record(scanner.mirrors),
    )
