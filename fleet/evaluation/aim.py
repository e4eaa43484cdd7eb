"""How far off a calibrated scanner aims, and the bound of any calibration."""

import numpy as np

from fleet.simulation.scanning import true_angles
from robot_agent.calibration.scanner.fit import Noise, covariance_of
from tagmap.conventions import Array
from tagmap.geometry.scanner.scanner import Scanner, point


def aim_error_m(found: Scanner, truth: Scanner, p_cam: Array) -> float:
    """RMS miss of true targets (N, 3): aimed at with what was found, beams of the truth."""
    return rms_miss_m(truth, true_angles(found, p_cam), p_cam)


def rms_miss_m(truth: Scanner, theta: Array, p_cam: Array) -> float:
    """The same for mirror angles (N, 2), however they were found."""
    off = point(truth, theta, p_cam).off
    return float(np.sqrt(np.mean((off**2).sum(axis=-1))))


def aim_bound_m(truth: Scanner, sampled_at: Array, noise: Noise, p_cam: Array) -> float:
    """Cramer-Rao bound of the same for samples at true targets (M, 3), without any prior.

    A sample is a constraint between things measured; its information on the scanner is J^T C^-1 J
    with C the noise of angles and target carried through the constraint.
    """
    samples = point(truth, true_angles(truth, sampled_at), sampled_at)
    J = samples.by_scanner
    weighted = np.linalg.solve(covariance_of(samples, noise), J)
    information = np.einsum("nki,nkj->ij", J, weighted)
    G = point(truth, true_angles(truth, p_cam), p_cam).by_scanner
    scale = np.sqrt(np.diag(information))
    cov = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return float(np.sqrt(np.einsum("nki,ij,nkj->n", G, cov, G).mean()))
