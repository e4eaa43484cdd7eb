"""Scanners that are off in every way, and samples of their beams, to try calibrations."""

from dataclasses import replace

import numpy as np

from robot_agent.calibration.scanner.fit import Noise
from robot_agent.calibration.scanner.online import Hit
from robot_agent.calibration.scanner.samples import Samples
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.scanner.inverse import angles_to
from tagmap.geometry.scanner.mirrors import Mirrors
from tagmap.geometry.scanner.scanner import MODELS, Scanner, point

NOISE = Noise(theta_rad=3e-4, point_m=2e-3)
SIGMA_MIDDLE_M = 1e-3
TAG_RADIUS_M = 0.02
"""Within which a beam of some width lights a tag."""
SKEW_RAD, OFFSET_M, ASKEW_RAD = np.radians(2.0), 3e-3, np.radians(1.0)
SEPARATION_M = (0.01, 0.03)
FIELD = np.array([0.36, 0.27])
"""Half the view as slopes: 20 and 15 degrees."""
GRID = (5, 3)
GRID_DEPTHS_M, DEPTHS_M = (2.5, 7.5), (2.5, 7.5)

# The beam leaves along z of cam; x of laser is to the right.
_R_CAM_LASER = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def built(rng: np.random.Generator) -> Scanner:
    """A scanner whose axes are 2 degrees from perpendicular, whose incident ray is 3 mm and 1
    degree off each way, and whose mount is off by a few degrees."""
    skew, y, z, yaw, pitch = rng.choice([-1.0, 1.0], 5)
    mirrors = Mirrors(
        separation_m=rng.uniform(*SEPARATION_M),
        skew_rad=SKEW_RAD * skew,
        incident_y_m=OFFSET_M * y,
        incident_z_m=OFFSET_M * z,
        incident_yaw_rad=ASKEW_RAD * yaw,
        incident_pitch_rad=ASKEW_RAD * pitch,
    )
    turned = np.concatenate([np.zeros(3), rng.normal(0.0, 0.05, 3)])
    p = np.array([0.05, -0.08, 0.0]) + rng.uniform(-0.02, 0.02, 3)
    T_cam_laser = se3.from_p_R(p, _R_CAM_LASER) @ se3.exp(turned)
    return Scanner(mirrors, T_cam_laser, MODELS["full"], np.zeros((12, 12)))


def field_grid() -> Array:
    """(30, 3) targets in cam: 5 by 3 over the view, at both GRID_DEPTHS_M."""
    slopes = np.stack(
        np.meshgrid(*(np.linspace(-f, f, n) for f, n in zip(FIELD, GRID, strict=True)))
    )
    plane = np.concatenate([slopes, np.ones((1, *slopes.shape[1:]))]).reshape(3, -1).T
    return np.concatenate([depth * plane for depth in GRID_DEPTHS_M])


def anywhere(rng: np.random.Generator, n: int, depth_m: tuple[float, float] = DEPTHS_M) -> Array:
    """(n, 3) targets in cam, in the view, at depths between the two."""
    z = rng.uniform(*depth_m, n)
    return np.concatenate([z * FIELD[:, None] * rng.uniform(-1.0, 1.0, (2, n)), z[None]]).T


def true_angles(scanner: Scanner, p_cam: Array) -> Array:
    """(..., 2) that light targets (..., 3)."""
    return angles_to(scanner.mirrors, se3.act(se3.inverse(scanner.T_cam_laser), p_cam))


def sampled(
    scanner: Scanner, p_cam: Array, rng: np.random.Generator, noise: Noise = NOISE
) -> Samples:
    """Beams that met true targets (N, 3), measured with noise; lines as in a file."""
    theta = true_angles(scanner, p_cam)
    return Samples(
        theta + noise.theta_rad * rng.standard_normal(theta.shape),
        p_cam + noise.point_m * rng.standard_normal(p_cam.shape),
        np.arange(2, 2 + len(p_cam)),
    )


def turned(scanner: Scanner, turn_rad: Array) -> Scanner:
    """With its mount turned by turn_rad (3,) about the axes of laser."""
    T_cam_laser = scanner.T_cam_laser @ se3.exp(np.concatenate([np.zeros(3), turn_rad]))
    return replace(scanner, T_cam_laser=T_cam_laser)


def seen(rng: np.random.Generator) -> tuple[Array, Array]:
    """A target (3,), and where it is measured."""
    p_cam = anywhere(rng, 1)[0]
    return p_cam, p_cam + NOISE.point_m * rng.standard_normal(3)


def hit_of(truth: Scanner, p_cam: Array, p_seen: Array, rng: np.random.Generator) -> Hit:
    """The middle of what lights a target, as probing would find it."""
    lit = true_angles(truth, p_cam)
    by_theta = point(truth, lit, p_cam).by_theta
    probed = np.linalg.solve(by_theta, SIGMA_MIDDLE_M * rng.standard_normal(2))
    theta = lit + probed + NOISE.theta_rad * rng.standard_normal(2)
    return Hit(theta, p_seen, NOISE.point_m**2 * np.eye(3), NOISE.theta_rad, SIGMA_MIDDLE_M)


def misses(known: Scanner, truth: Scanner, p_cam: Array) -> bool:
    """Whether beams aimed with what is known leave any of the tags (N, 3) dark, noise apart."""
    off = point(truth, true_angles(known, p_cam), p_cam).off
    return bool(((off**2).sum(axis=-1) > TAG_RADIUS_M**2).any())
