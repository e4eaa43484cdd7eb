"""The most likely stereo rig for given corners; OpenCV does the work, residuals are ours.

Zhang (2000) per camera as a start, then all parameters of both cameras, of the rig and of the
board's poses together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from robot_agent.calibration.board import Board
from tagmap.conventions import Array
from tagmap.errors import DegenerateError
from tagmap.geometry import se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig, project

ITERATIONS, TOLERANCE = 100, 1e-9


@dataclass(frozen=True, slots=True)
class View:
    """The corners of one pair, raw pixels (N, 2) each, in the order of `Board.points`; the smaller
    of the windows that refined them; `customary_px` (N, 4), had it been CUSTOMARY_WINDOW_PX."""

    name: str
    left_px: Array
    right_px: Array
    window_px: int
    customary_px: Array

    @property
    def stereo_px(self) -> Array:
        """(N, 4)"""
        return np.concatenate([self.left_px, self.right_px], axis=-1)


@dataclass(frozen=True, slots=True)
class Fit:
    """A rig, the board's poses T_cam_board (P, 4, 4), and residuals (P, N, 4) px, seen - fitted.

    `fits_k3`: whether k3 was estimated; it is 0 otherwise.
    """

    rig: StereoRig
    T_cam_board: Array
    residual_px: Array
    fits_k3: bool

    @property
    def rms_px(self) -> float:
        """Root mean square distance of a corner from where it should be, as OpenCV has it."""
        return float(np.sqrt(2.0 * np.mean(self.residual_px**2)))

    @property
    def baseline_m(self) -> float:
        return float(np.linalg.norm(self.rig.T_right_left[:3, 3]))

    @property
    def squares_px2(self) -> float:
        """Sum of squared residuals."""
        return float(np.sum(self.residual_px**2))

    @property
    def camera_rms_px(self) -> Array:
        """(2,) the same for left and right."""
        rms_px: Array = np.sqrt(2.0 * np.mean(_by_camera(self.residual_px), axis=(0, 1, 3)))
        return rms_px

    @property
    def pair_rms_px(self) -> Array:
        """(P, 2) the same for left and right of each pair."""
        rms_px: Array = np.sqrt(2.0 * np.mean(_by_camera(self.residual_px), axis=(1, 3)))
        return rms_px


def _by_camera(residual_px: Array) -> Array:
    """Squares (P, N, 2, 2)."""
    return residual_px.reshape(*residual_px.shape[:2], 2, 2) ** 2


def fit_rig(views: Sequence[View], size_px: tuple[int, int], board: Board, fits_k3: bool) -> Fit:
    """size_px: width and height of all images. Raises DegenerateError where OpenCV finds nothing.

    sigma_px of the rig is the deviation of one coordinate of the residuals, with the degrees of
    freedom counted.
    """
    import cv2

    flags = 0 if fits_k3 else cv2.CALIB_FIX_K3
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, ITERATIONS, TOLERANCE)
    points = [board.points.astype(np.float32)] * len(views)
    left = [view.left_px.astype(np.float32) for view in views]
    right = [view.right_px.astype(np.float32) for view in views]
    try:
        # OpenCV writes into the matrices it is given: each call has its own.
        starts = [
            cv2.calibrateCamera(points, px, size_px, np.eye(3), np.zeros(5), flags=flags)[1:3]
            for px in (left, right)
        ]
        _, K_left, dist_left, K_right, dist_right, R, p, _, _, rotations, positions, _ = (
            cv2.stereoCalibrateExtended(
                points, left, right, *starts[0], *starts[1], size_px, np.eye(3), np.zeros(3),
                flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS, criteria=until,
            )
        )  # fmt: skip
    except cv2.error as error:
        raise DegenerateError(
            f"{len(views)} pairs determine no cameras (OpenCV: {error.err})"
        ) from None
    T_cam_board = np.stack(
        [_matrix(cv2.Rodrigues(r)[0], p) for r, p in zip(rotations, positions, strict=True)]
    )
    cameras = _camera(K_left, dist_left, size_px), _camera(K_right, dist_right, size_px)
    return _judged(views, board, cameras, _matrix(R, p), T_cam_board, fits_k3)


def _judged(
    views: Sequence[View],
    board: Board,
    cameras: tuple[Camera, Camera],
    T_right_left: Array,
    T_cam_board: Array,
    fits_k3: bool,
) -> Fit:
    """The residuals by the forward model that everything else uses, and their deviation."""
    seen = np.stack([view.stereo_px for view in views])
    p_cam = se3.act(T_cam_board[:, None], board.points)
    fitted, _ = project(StereoRig(*cameras, T_right_left, sigma_px=1.0), p_cam)
    residual = seen - fitted
    if not np.isfinite(residual).all():
        raise DegenerateError(f"{len(views)} pairs: a board would be behind a camera")
    freedom = residual.size - 6 * len(views) - (24 if fits_k3 else 22)
    sigma_px = float(np.sqrt(np.sum(residual**2) / freedom))
    return Fit(StereoRig(*cameras, T_right_left, sigma_px), T_cam_board, residual, fits_k3)


def _camera(K: ArrayLike, dist: ArrayLike, size_px: tuple[int, int]) -> Camera:
    width_px, height_px = size_px
    (fx, _, cx), (_, fy, cy), _ = np.asarray(K, dtype=np.float64).tolist()
    dist = np.asarray(dist, dtype=np.float64).ravel()[:5]
    return Camera(width_px, height_px, fx, fy, cx, cy, dist)


def _matrix(R: ArrayLike, p: ArrayLike) -> Array:
    return se3.from_p_R(np.ravel(np.asarray(p, dtype=np.float64)), np.asarray(R, dtype=np.float64))
