"""A camera on a pan-tilt unit: from angles a person can picture, by differences, by Monte Carlo."""

import numpy as np
import pytest

from tagmap.geometry import pan_tilt, se3, so3
from tagmap.geometry.pan_tilt import PanTiltMount
from tests.geometry.rigs import central_differences

FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""R_tilt_cam of a camera that looks along x with its image upright."""


def at(x: float, y: float, z: float, R: np.ndarray | None = None) -> np.ndarray:
    return se3.from_p_R(np.array([x, y, z]), np.eye(3) if R is None else R)


MOUNT = PanTiltMount(at(0.1, 0.0, 0.5), at(0.0, 0.0, 0.09), at(0.0, 0.0, 0.04, FORWARD))
CROOKED = PanTiltMount(
    se3.exp(np.array([0.1, -0.2, 0.5, 0.02, -0.01, 0.3])),
    se3.exp(np.array([0.01, 0.02, 0.09, 0.01, 0.03, -0.02])),
    se3.exp(np.array([0.0, 0.03, 0.04, -0.5, 0.4, -1.0])),
)


@pytest.mark.parametrize(
    ("angles", "optical_axis", "p_base"),
    [
        ((0.0, 0.0), (1.0, 0.0, 0.0), (0.1, 0.0, 0.63)),
        ((np.pi / 2, 0.0), (0.0, 1.0, 0.0), (0.1, 0.0, 0.63)),
        ((0.0, np.pi / 2), (0.0, 0.0, 1.0), (0.06, 0.0, 0.59)),
        ((np.pi / 2, np.pi / 2), (0.0, 0.0, 1.0), (0.1, -0.04, 0.59)),
        ((0.0, -np.pi / 2), (0.0, 0.0, -1.0), (0.14, 0.0, 0.59)),
    ],
)
def test_pan_turns_left_and_tilt_raises(
    angles: tuple[float, float],
    optical_axis: tuple[float, float, float],
    p_base: tuple[float, float, float],
):
    T_base_cam = pan_tilt.camera_pose(MOUNT, np.array(angles))
    np.testing.assert_allclose(T_base_cam[:3, 2], optical_axis, atol=1e-12)
    np.testing.assert_allclose(T_base_cam[:3, 3], p_base, atol=1e-12)


@pytest.mark.parametrize("mount", [MOUNT, CROOKED])
@pytest.mark.parametrize("shape", [(), (5,), (2, 3)])
def test_jacobian_by_central_differences(mount: PanTiltMount, shape: tuple[int, ...]):
    angles = np.random.default_rng(0).uniform(-1.5, 1.5, (*shape, 2))
    T_cam_base = se3.inverse(pan_tilt.camera_pose(mount, angles))
    numerical = central_differences(
        lambda a: se3.log(T_cam_base @ pan_tilt.camera_pose(mount, a)), angles, 1e-6
    )
    np.testing.assert_allclose(pan_tilt.jacobian(mount, angles), numerical, atol=1e-8)


def test_covariance_by_monte_carlo():
    rng, sigma = np.random.default_rng(1), np.array([2e-3, 1e-3])
    angles = np.array([0.4, -0.3])
    drawn = pan_tilt.camera_pose(CROOKED, angles + sigma * rng.standard_normal((20_000, 2)))
    errors = se3.log(se3.inverse(pan_tilt.camera_pose(CROOKED, angles)) @ drawn)
    cov = pan_tilt.covariance(CROOKED, angles, sigma)
    np.testing.assert_allclose(np.cov(errors.T), cov, atol=0.04 * cov.diagonal().max())
    assert np.linalg.matrix_rank(cov) == 2


def test_a_unit_hung_upside_down_is_a_mount_like_any():
    hung = PanTiltMount(
        at(0.0, 0.0, 2.0, so3.exp(np.array([np.pi, 0.0, 0.0]))), MOUNT.T_pan_tilt, MOUNT.T_tilt_cam
    )
    T_base_cam = pan_tilt.camera_pose(hung, np.array([np.pi / 2, 0.0]))
    np.testing.assert_allclose(T_base_cam[:3, 2], (0.0, -1.0, 0.0), atol=1e-12)
