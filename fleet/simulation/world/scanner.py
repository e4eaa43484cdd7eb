"""A robot's laser scanner: as it is, and as its owner calibrated it."""

from functools import lru_cache

import numpy as np

from fleet.simulation.scanning import NOISE, built, sampled
from fleet.simulation.world.chances import stream
from robot_agent.calibration.scanner.calibration import calibrate
from robot_agent.calibration.scanner.report import as_record
from tagmap.conventions import Array
from tagmap.geometry.scanner.scanner import Scanner
from tagmap.records.arrays import mirror_record, transform, upper
from tagmap.records.scanner import DriveLimits, ScannerCalibration

SLOPES = np.linspace(-0.5, 0.5, 5)
DEPTHS_M = (2.0, 6.0)
"""Targets of the calibration: over what the mirrors reach, at two depths."""
TINY = 1e-6
"""A deviation, in m and rad, where there is none: a covariance must be positive."""


@lru_cache(maxsize=64)
def calibrated(seed: int, name: str) -> tuple[Scanner, ScannerCalibration]:
    """From simulated samples of the true one."""
    rng = stream(seed, "scanner", name)
    truth = built(rng)
    found = calibrate("full", sampled(truth, targets(), rng), NOISE)
    return truth, as_record(found, DriveLimits(), "", "simulation")


def exact(seed: int, name: str) -> tuple[Scanner, ScannerCalibration]:
    """One that is known exactly."""
    truth = built(stream(seed, "scanner", name))
    n = 6 + len(truth.free)
    record = ScannerCalibration(
        model="full",
        by="simulation",
        sigma_theta_rad=NOISE.theta_rad,
        sigma_point_m=NOISE.point_m,
        cov=upper(TINY**2 * np.eye(n)),
        T_cam_laser=transform(truth.T_cam_laser),
        mirrors=mirror_record(truth.mirrors),
    )
    return truth, record


def targets() -> Array:
    """(50, 3) in cam."""
    x, y = np.meshgrid(SLOPES, SLOPES)
    rays = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    return np.concatenate([depth * rays for depth in DEPTHS_M])
