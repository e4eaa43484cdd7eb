"""Jacobians against central differences through the real update; covariance against the spread."""

from dataclasses import replace

import numpy as np
import pytest

from fleet.simulation.chessboard import TRIAL_BOARD
from robot_agent.calibration.fit import fit_rig
from robot_agent.calibration.uncertainty import K3, _jacobians, sigmas
from tagmap.geometry import se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig, project


@pytest.fixture(scope="module")
def fit(make_views):
    return fit_rig(make_views(0, count=6), (640, 480), TRIAL_BOARD, fits_k3=True)


def moved_camera(camera, delta):
    fx, fy, cx, cy = np.array([*camera.focal_px, *camera.centre_px]) + delta[:4]
    return Camera(camera.width_px, camera.height_px, fx, fy, cx, cy, camera.dist + delta[4:])


def predicted(fit, of_rig, of_board):
    rig = StereoRig(
        moved_camera(fit.rig.left, of_rig[:9]),
        moved_camera(fit.rig.right, of_rig[9:18]),
        fit.rig.T_right_left @ se3.exp(of_rig[18:]),
        1.0,
    )
    T_cam_board = fit.T_cam_board @ se3.exp(of_board)
    px, _ = project(rig, se3.act(T_cam_board[:, None], TRIAL_BOARD.points))
    return px.reshape(len(px), -1)


def test_jacobians_are_the_slopes_of_the_forward_model(fit):
    A, B = _jacobians(fit, TRIAL_BOARD)
    h = 1e-6
    for i, step in enumerate(h * np.eye(24)):
        slope = (predicted(fit, step, np.zeros(6)) - predicted(fit, -step, np.zeros(6))) / (2 * h)
        assert np.allclose(A[:, :, i], slope, rtol=1e-5, atol=1e-5), i
    for i, step in enumerate(h * np.eye(6)):
        slope = (predicted(fit, np.zeros(24), step) - predicted(fit, np.zeros(24), -step)) / (2 * h)
        assert np.allclose(B[:, :, i], slope, rtol=1e-5, atol=1e-4), i


def test_the_fit_is_a_minimum(fit):
    """No direction in which OpenCV left the residuals a slope worth a hundredth of a deviation."""
    A, B = _jacobians(fit, TRIAL_BOARD)
    residual = fit.residual_px.reshape(len(A), -1)
    full = np.zeros((residual.size, 24 + 6 * len(A)))
    rows = residual.shape[1]
    for k in range(len(A)):
        full[k * rows : (k + 1) * rows, :24] = A[k]
        full[k * rows : (k + 1) * rows, 24 + 6 * k : 30 + 6 * k] = B[k]
    scale = np.linalg.norm(full, axis=0)
    step, *_ = np.linalg.lstsq(full / scale, residual.ravel())
    cov = np.linalg.inv((full / scale).T @ (full / scale)) * fit.rig.sigma_px**2
    assert np.abs(step / np.sqrt(np.diag(cov))).max() < 0.02
    assert np.allclose(
        sigmas(fit, TRIAL_BOARD).left, (np.sqrt(np.diag(cov)) / scale)[:9], rtol=1e-6
    )


def test_what_is_not_fitted_has_no_deviation(fit):
    sigma = sigmas(replace(fit, fits_k3=False), TRIAL_BOARD)
    assert sigma.left[K3] == sigma.right[K3] == 0.0
    assert (sigma.left[:K3] > 0.0).all()
    assert sigma.baseline_m == pytest.approx(sigma.p_m[0], rel=0.1)
