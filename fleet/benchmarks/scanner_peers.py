"""A peer: the scanner as a pinhole camera whose pixels are tangents of its mirror angles.

All eleven numbers of a projective camera are free (Hartley & Zisserman 2004, 7.1 and 7.2: linear
start, then the most likely one), so that it can make up for much of what it lacks.
"""

import numpy as np

from robot_agent.calibration.scanner.fit import Noise
from robot_agent.calibration.scanner.samples import Samples
from tagmap.conventions import Array


def projective(samples: Samples, noise: Noise) -> Array:
    """(3, 4) from points of cam to homogeneous pixels."""
    from scipy.optimize import least_squares

    seen = _pixels(samples.theta)
    points = np.insert(samples.p_cam, 3, 1.0, axis=1)
    none = np.zeros_like(points)
    rows = np.concatenate(
        [
            np.concatenate([points, none, -seen[:, :1] * points], axis=1),
            np.concatenate([none, points, -seen[:, 1:] * points], axis=1),
        ]
    )
    start = np.linalg.svd(rows)[2][-1].reshape(3, 4)
    range_m = np.linalg.norm(samples.p_cam, axis=1)[:, None]
    sigma = np.sqrt((2.0 * noise.theta_rad) ** 2 + (noise.point_m / range_m) ** 2)

    def residual(P: Array) -> Array:
        off: Array = ((_project(P.reshape(3, 4), samples.p_cam) - seen) / sigma).ravel()
        return off

    start /= np.linalg.norm(start[2, :3])
    found: Array = least_squares(residual, start.ravel(), x_scale="jac").x.reshape(3, 4)
    return found


def aim_projective(P: Array, p_cam: Array) -> Array:
    """Mirror angles (N, 2) for targets (N, 3)."""
    u, v = _project(P, p_cam).T
    theta_2 = 0.5 * np.arctan(v)
    theta_1 = -0.5 * np.arctan(u * np.cos(2.0 * theta_2))
    return np.stack([theta_1, theta_2], axis=-1)


def _pixels(theta: Array) -> Array:
    """(N, 2) where the ideal scanner's direction meets the plane y = 1."""
    x, y = 2.0 * theta.T
    return np.stack([-np.tan(x) / np.cos(y), np.tan(y)], axis=-1)


def _project(P: Array, p_cam: Array) -> Array:
    homogeneous = p_cam @ P[:, :3].T + P[:, 3]
    pixels: Array = homogeneous[:, :2] / homogeneous[:, 2:]
    return pixels
