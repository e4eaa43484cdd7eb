"""Mirror angles that send the beam through a point: there is no single centre of projection, so
the target is a point, not a direction."""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.scanner.mirrors import Mirrors
from tagmap.geometry.scanner.miss import miss

STEPS = 20
CONVERGED_RAD = 1e-13
RELATIVE_MISS = 1e-12
LARGEST_STEP_RAD = 0.2


def angles_to(mirrors: Mirrors, p_laser: Array) -> Array:
    """theta (..., 2) in rad, X first, whose beam passes through points (..., 3) of laser.

    Newton's method from the simplified model; NaN where no beam goes.
    """
    theta = _ideal(mirrors, p_laser)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(STEPS):
            there = miss(mirrors, theta, p_laser)
            step = _solve(there.by_theta, there.off)
            theta = theta - np.clip(step, -LARGEST_STEP_RAD, LARGEST_STEP_RAD)
            if not (np.abs(step) > CONVERGED_RAD).any():
                break
        there = miss(mirrors, theta, p_laser)
        off = np.sqrt((there.off**2).sum(axis=-1))
        hits = (there.ahead > 0.0) & (off <= RELATIVE_MISS * (1.0 + there.ahead))
        return np.where(hits[..., None], theta, np.nan)


def _ideal(mirrors: Mirrors, p_laser: Array) -> Array:
    """Exact for the simplified model: thesis, eq. 3.10."""
    x, y, z = p_laser[..., 0], p_laser[..., 1], p_laser[..., 2]
    theta_1 = -0.5 * np.arctan2(x, np.sqrt(y * y + z * z) + mirrors.separation_m)
    theta_2 = 0.5 * np.arctan2(z, y)
    neutral = np.array([mirrors.neutral_1_rad, mirrors.neutral_2_rad]) - np.pi / 4.0
    neutral[0] += 0.5 * mirrors.incident_pitch_rad
    return np.stack([theta_1, theta_2], axis=-1) + neutral


def _solve(J: Array, off: Array) -> Array:
    """J^-1 off of (..., 2, 2) and (..., 2); singular ones give no finite step."""
    a, b, c, d = J[..., 0, 0], J[..., 0, 1], J[..., 1, 0], J[..., 1, 1]
    u, v = off[..., 0], off[..., 1]
    return np.stack([d * u - b * v, a * v - c * u], axis=-1) / (a * d - b * c)[..., None]
