"""A galvo scanner a person can picture: axes 15 mm apart, and off in every way it can be."""

import numpy as np

from tagmap.geometry import se3
from tagmap.geometry.scanner.drive import Drive
from tagmap.geometry.scanner.mirrors import Mirrors
from tagmap.geometry.scanner.scanner import MODELS, Scanner

IDEAL = Mirrors(0.015)
SKEWED = Mirrors(0.015, 0.035, 0.77, 0.8, 0.003, -0.003, 0.02, -0.015)

# The beam leaves along z of cam, mirror Y's axis to the right, 10 cm above the camera.
R_CAM_LASER = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
T_CAM_LASER = se3.from_p_R(np.array([0.02, -0.1, 0.01]), R_CAM_LASER) @ se3.exp(
    np.array([0.0, 0.0, 0.0, 0.01, -0.02, 0.03])
)
SCANNER = Scanner(SKEWED, T_CAM_LASER, MODELS["full"], 1e-6 * np.eye(12))
DRIVE = Drive(
    limits_rad=np.array([[-0.3, 0.3], [-0.25, 0.25]]),
    v_per_rad=np.array([20.0, -25.0]),
    v_at_zero=np.array([0.1, -0.2]),
    limits_v=np.array([-8.0, 5.0]),
    dac_v=np.array([-10.0, 10.0]),
    dac_bits=16,
)


def targets(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """(*shape, 3) in cam, 2 to 8 m ahead, within 15 degrees of its axis."""
    z = rng.uniform(2.0, 8.0, shape)
    return np.stack(
        [z * rng.uniform(-0.25, 0.25, shape), z * rng.uniform(-0.25, 0.25, shape), z], -1
    )
