"""How well the corners determine a rig: standard deviations of all its parameters.

    J^T J =  | A_1^T A_1 + ... + A_P^T A_P   A_1^T B_1  ...  A_P^T B_P |   rig: 24 parameters
             | B_1^T A_1                     B_1^T B_1                 |   board of pair 1: 6
             | ...                                      ...            |
             | B_P^T A_P                                     B_P^T B_P |   board of pair P: 6

The boards' poses are eliminated (Schur complement); what is left is the information on the rig.
The deviations hold for corner errors that are independent of each other: a bent board is not.
"""

from dataclasses import dataclass

import numpy as np

from robot_agent.calibration.board import Board
from robot_agent.calibration.fit import Fit
from tagmap.conventions import Array
from tagmap.errors import DegenerateError
from tagmap.geometry import se3
from tagmap.geometry.camera import Camera, distort, project

SINGULAR = 1e-12
CAMERA = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
K3 = CAMERA.index("k3")


@dataclass(frozen=True, slots=True)
class Sigmas:
    """Standard deviations: left, right (9,) in the order of CAMERA; p_m (3,) of T_right_left, its
    rotation (3,) about the left camera's axes, baseline_m. 0 for a k3 that is not fitted."""

    left: Array
    right: Array
    p_m: Array
    rotation_rad: Array
    baseline_m: float


def sigmas(fit: Fit, board: Board) -> Sigmas:
    """Raises DegenerateError where some parameter is not determined at all."""
    cov = _covariance(fit, board)
    sigma = np.sqrt(np.diag(cov))
    R, p = fit.rig.T_right_left[:3, :3], fit.rig.T_right_left[:3, 3]
    cov_p = R @ cov[18:21, 18:21] @ R.T
    along = p / np.linalg.norm(p)
    return Sigmas(
        left=sigma[:9],
        right=sigma[9:18],
        p_m=np.sqrt(np.diag(cov_p)),
        rotation_rad=sigma[21:],
        baseline_m=float(np.sqrt(along @ cov_p @ along)),
    )


def _covariance(fit: Fit, board: Board) -> Array:
    """(24, 24) of left (9), right (9), and T_right_left @ exp(delta) (6)."""
    A, B = _jacobians(fit, board)
    B_A = np.swapaxes(B, -1, -2) @ A
    information = np.einsum("pni,pnj->ij", A, A) - np.einsum(
        "pki,pkj->ij", B_A, np.linalg.solve(np.swapaxes(B, -1, -2) @ B, B_A)
    )
    fitted = np.array([i for i in range(24) if fit.fits_k3 or i not in (K3, 9 + K3)])
    information = information[np.ix_(fitted, fitted)]
    # Focal lengths in px and k3 differ by orders of magnitude: compare them without units.
    scale = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    if not values[0] > SINGULAR:
        raise DegenerateError("the pairs leave a parameter open; tilt the board differently")
    cov = np.zeros((24, 24))
    inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
    cov[np.ix_(fitted, fitted)] = fit.rig.sigma_px**2 * inverse
    return cov


def _jacobians(fit: Fit, board: Board) -> tuple[Array, Array]:
    """A (P, 4 N, 24) by the rig's parameters, B (P, 4 N, 6) by T_cam_board @ exp(delta)."""
    rig, T_right_left = fit.rig, fit.rig.T_right_left
    p_board = board.points
    p_left = se3.act(fit.T_cam_board[:, None], p_board)
    p_right = se3.act(T_right_left, p_left)
    left_by_board = se3.act_jacobian(fit.T_cam_board[:, None], p_board)
    right_by_rig = se3.act_jacobian(T_right_left, p_left)
    _, J_left = project(rig.left, p_left)
    _, J_right = project(rig.right, p_right)
    pairs, corners = p_left.shape[:2]
    A = np.zeros((pairs, corners, 4, 24))
    A[:, :, :2, :9] = _by_intrinsics(rig.left, p_left)
    A[:, :, 2:, 9:18] = _by_intrinsics(rig.right, p_right)
    A[:, :, 2:, 18:] = J_right @ right_by_rig
    B = np.concatenate(
        [J_left @ left_by_board, J_right @ T_right_left[:3, :3] @ left_by_board], axis=-2
    )
    return A.reshape(pairs, 4 * corners, 24), B.reshape(pairs, 4 * corners, 6)


def _by_intrinsics(camera: Camera, p_cam: Array) -> Array:
    """(..., 2, 9) by fx fy cx cy k1 k2 p1 p2 k3 at points (..., 3)."""
    ray = p_cam[..., :2] / p_cam[..., 2:]
    distorted, _ = distort(camera, ray)
    x, y = ray[..., 0], ray[..., 1]
    r2 = x * x + y * y
    J = np.zeros((*ray.shape, 9))
    J[..., 0, 0], J[..., 1, 1] = distorted[..., 0], distorted[..., 1]
    J[..., 0, 2] = J[..., 1, 3] = 1.0
    by_dist = np.stack(
        [
            np.stack([x * r2, x * r2**2, 2.0 * x * y, r2 + 2.0 * x * x, x * r2**3], axis=-1),
            np.stack([y * r2, y * r2**2, r2 + 2.0 * y * y, 2.0 * x * y, y * r2**3], axis=-1),
        ],
        axis=-2,
    )
    J[..., 4:] = camera.focal_px[:, None] * by_dist
    return J
