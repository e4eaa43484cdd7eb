"""Boards in front of a small rig: as exact corners, and as images."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from fleet.simulation.chessboard import TRIAL_BOARD, TRIAL_RIG, poses, write_pairs
from robot_agent.calibration.fit import View
from tagmap.geometry import se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig, project

SMALL_RIG = StereoRig(
    Camera(320, 240, 260.0, 261.0, 158.0, 121.0, np.array([-0.2, 0.05, 1e-3, -5e-4, 0.0])),
    Camera(320, 240, 263.0, 262.0, 162.0, 118.0, np.array([-0.2, 0.04, -4e-4, 6e-4, 0.0])),
    se3.exp(np.array([-0.08, 1e-3, 2e-3, 0.01, 0.03, -5e-3])),
    sigma_px=0.1,
)


@pytest.fixture(scope="session")
def make_views() -> Callable[..., list[View]]:
    """`make_views(seed, count, sigma_px)`: corners by the forward model, with noise."""

    def make(seed: int, count: int = 12, sigma_px: float = 0.1) -> list[View]:
        rng = np.random.default_rng(seed)
        T_cam_board = poses(rng, count)
        px, _ = project(TRIAL_RIG, se3.act(T_cam_board[:, None], TRIAL_BOARD.points))
        px += sigma_px * rng.standard_normal(px.shape)
        return [View(f"{i:02d}", p[:, :2], p[:, 2:], 11, p) for i, p in enumerate(px, start=1)]

    return make


@pytest.fixture(scope="session")
def boards_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight pairs taken by SMALL_RIG; in pair 03 the board moved between the exposures."""
    folder = tmp_path_factory.mktemp("boards")
    T_cam_board = poses(np.random.default_rng(3), 8, SMALL_RIG)
    write_pairs(folder, T_cam_board, SMALL_RIG)
    moved = tmp_path_factory.mktemp("moved")
    write_pairs(moved, T_cam_board[[2]] @ se3.exp(np.array([8e-3, 0, 0, 0, 0, 0])), SMALL_RIG)
    (moved / "right01.png").replace(folder / "right03.png")
    return folder


@pytest.fixture
def some_boards(boards_folder: Path, tmp_path: Path) -> Callable[[Sequence[int]], Path]:
    """`some_boards([1, 2])`: a folder of one's own with these pairs."""

    def copy(pairs: Sequence[int]) -> Path:
        folder = tmp_path / "some"
        folder.mkdir()
        for i in pairs:
            for side in ("left", "right"):
                name = f"{side}{i:02d}.png"
                (folder / name).write_bytes((boards_folder / name).read_bytes())
        return folder

    return copy


@pytest.fixture(scope="session")
def small_rig() -> StereoRig:
    return SMALL_RIG
