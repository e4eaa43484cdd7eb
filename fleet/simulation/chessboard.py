"""Images of a chessboard in front of a stereo rig, to try a calibration without cameras."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robot_agent.calibration.board import Board
from tagmap.conventions import Array
from tagmap.geometry import se3, so3, stereo
from tagmap.geometry.camera import Camera, undistort
from tagmap.geometry.stereo import StereoRig

BLACK, WHITE, WALL = 30.0, 220.0, 110.0
TRIAL_BOARD = Board(cols=9, rows=6, square_m=0.03)
TRIAL_RIG = StereoRig(
    Camera(640, 480, 520.0, 521.0, 318.0, 243.0, np.array([-0.28, 0.09, 1e-3, -5e-4, 0.0])),
    Camera(640, 480, 524.0, 523.0, 325.0, 236.0, np.array([-0.27, 0.08, -4e-4, 6e-4, 0.0])),
    se3.exp(np.array([-0.12, 1e-3, 2e-3, 0.01, 0.03, -5e-3])),
    sigma_px=0.05,
)
MARGIN = 0.6
"""White around the squares, in squares."""
SHARPNESS = 3
"""Rays per pixel and axis: light is averaged over each pixel."""


@dataclass(frozen=True, slots=True)
class Imaging:
    """Blur of the lens and noise of the sensor: deviations in px and in grey levels."""

    blur_px: float = 0.7
    noise: float = 2.0


def poses(
    rng: np.random.Generator, count: int, rig: StereoRig = TRIAL_RIG, board: Board = TRIAL_BOARD
) -> Array:
    """T_cam_board (count, 4, 4): near and far, tilted to all sides, whole in both images."""
    outline = _outline(board)
    last_px = np.array([rig.left.width_px, rig.left.height_px] * 2) - 3.0
    found: list[Array] = []
    while len(found) < count:
        T_cam_board = _anywhere(rng, rig.left, outline)
        px, _ = stereo.project(rig, se3.act(T_cam_board, outline))
        if ((px > 2.0) & (px < last_px)).all():
            found.append(T_cam_board)
    return np.stack(found)


def _anywhere(rng: np.random.Generator, camera: Camera, outline: Array) -> Array:
    """A board that fills between a half and all of the image's width, about in its middle."""
    fills_m = float(np.ptp(outline[:, 0])) * camera.fx_px / camera.width_px
    depth_m = fills_m * rng.uniform(1.1, 2.2)
    p = np.array([*rng.uniform(-0.5, 0.5, 2) * depth_m, depth_m])
    R = so3.exp(rng.uniform([-0.7, -0.7, -0.4], [0.7, 0.7, 0.4]))
    return se3.from_p_R(p - R @ outline.mean(axis=0), R)


def _outline(board: Board) -> Array:
    """(4, 3) corners of the printed sheet in m."""
    edge = board.square_m * (1.0 + MARGIN)
    x = -edge, (board.cols - 1) * board.square_m + edge
    y = -edge, (board.rows - 1) * board.square_m + edge
    return np.array([(u, v, 0.0) for u in x for v in y])


class Eye:
    """A camera that sees boards; its rays are found once for all images."""

    def __init__(self, camera: Camera) -> None:
        n = SHARPNESS
        u = (np.arange(n * camera.width_px) + 0.5) / n - 0.5
        v = (np.arange(n * camera.height_px) + 0.5) / n - 0.5
        self._rays = undistort(camera, np.stack(np.meshgrid(u, v), axis=-1)).astype(np.float32)

    def see(
        self, board: Board, T_cam_board: Array, imaging: Imaging, rng: np.random.Generator
    ) -> npt.NDArray[np.uint8]:
        """(height, width)"""
        from scipy.ndimage import gaussian_filter

        plane = np.linalg.inv(T_cam_board[:3, [0, 1, 3]]).astype(np.float32)
        x, y, w = np.moveaxis(self._rays @ plane[:, :2].T + plane[:, 2], -1, 0)
        light = _light(board, x / w / board.square_m, y / w / board.square_m)
        n = SHARPNESS
        light = light.reshape(light.shape[0] // n, n, light.shape[1] // n, n).mean(axis=(1, 3))
        light = gaussian_filter(light, imaging.blur_px)
        counted = light + imaging.noise * rng.standard_normal(light.shape)
        return np.clip(np.rint(counted), 0.0, 255.0).astype(np.uint8)


def _light(board: Board, x: npt.NDArray[np.float32], y: npt.NDArray[np.float32]) -> Array:
    """Grey levels at points of the board's plane, in squares from the first inner corner."""
    dark = (np.floor(x) + np.floor(y)) % 2.0 == 0.0
    squares = (x > -1.0) & (x < board.cols) & (y > -1.0) & (y < board.rows)
    across, down = board.cols + MARGIN, board.rows + MARGIN
    sheet = (x > -1.0 - MARGIN) & (x < across) & (y > -1.0 - MARGIN) & (y < down)
    return np.where(sheet, np.where(squares & dark, BLACK, WHITE), WALL)


def write_pairs(
    folder: Path,
    T_cam_board: Array,
    rig: StereoRig = TRIAL_RIG,
    board: Board = TRIAL_BOARD,
    seed: int = 0,
) -> None:
    """left01.png, right01.png, ... of the poses (N, 4, 4), into an existing folder."""
    import cv2

    rng = np.random.default_rng(seed)
    eyes = Eye(rig.left), Eye(rig.right)
    for i, T_left_board in enumerate(T_cam_board, start=1):
        seen_from = T_left_board, rig.T_right_left @ T_left_board
        for side, eye, T in zip(("left", "right"), eyes, seen_from, strict=True):
            _, encoded = cv2.imencode(".png", eye.see(board, T, Imaging(), rng))
            (folder / f"{side}{i:02d}.png").write_bytes(encoded.tobytes())
