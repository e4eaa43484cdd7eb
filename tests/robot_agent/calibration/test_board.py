import numpy as np
import pytest

from fleet.simulation.chessboard import TRIAL_BOARD, Eye, Imaging
from robot_agent.calibration.board import Board, find_corners, turned_alike
from tagmap.geometry import se3
from tagmap.geometry.camera import project

# Seen from 0.42 m and turned by 0.5 rad: squares between 14 and 21 px, half of them in a corner.
T_CAM_BOARD = se3.exp(np.array([-0.1, -0.07, 0.42, 0, 0, 0])) @ se3.exp(
    np.array([0, 0, 0, 0.2, 0.5, 0.1])
)


@pytest.fixture(scope="module")
def seen(small_rig):
    """An image of the board, and its true corners (rows, cols, 2)."""
    image = Eye(small_rig.left).see(TRIAL_BOARD, T_CAM_BOARD, Imaging(), np.random.default_rng(3))
    px, _ = project(small_rig.left, se3.act(T_CAM_BOARD, TRIAL_BOARD.points))
    return image, px.reshape(TRIAL_BOARD.rows, TRIAL_BOARD.cols, 2)


def test_corners_are_where_the_forward_model_has_them(seen):
    image, truth = seen
    corners = find_corners(image, TRIAL_BOARD)
    assert corners is not None
    error = turned_alike(truth, corners.px) - truth
    assert np.sqrt(np.mean(error**2)) < 0.08
    assert np.abs(error.mean(axis=(0, 1))).max() < 0.03


def test_a_window_larger_than_the_squares_is_worse(seen):
    """Why the window follows the squares."""
    image, truth = seen
    fixed = find_corners(image, TRIAL_BOARD, window_px=11)
    assert fixed is not None
    assert np.abs(turned_alike(truth, fixed.px) - truth).max() > 1.0
    own = find_corners(image, TRIAL_BOARD)
    assert own is not None
    assert own.window_px < fixed.window_px == 11
    assert np.array_equal(own.customary_px, fixed.px)


def test_large_images_are_searched_small_and_refined_in_full(seen):
    image, truth = seen
    large = np.kron(image, np.ones((5, 5), np.uint8))
    corners = find_corners(large, TRIAL_BOARD)
    assert corners is not None
    error = turned_alike(truth, corners.px) - (5.0 * truth + 2.0)
    assert np.sqrt(np.mean(error**2)) < 5.0 * 0.12


def test_no_board_and_the_wrong_board(seen):
    image, _ = seen
    assert find_corners(np.full_like(image, 128), TRIAL_BOARD) is None
    assert find_corners(image, Board(8, 8, 0.03)) is None


@pytest.mark.parametrize("rows", [6, 9])
def test_both_images_number_the_corners_alike(rows: int):
    """Whatever end the search began at; a square board may come turned by a quarter."""
    y, x = np.mgrid[:rows, :9].astype(float)
    left = np.stack([20 * x + 2 * y, 19 * y - x], axis=-1)
    right = left + np.array([5.0, 1.0])
    for k in range(4) if rows == 9 else (0, 2):
        assert np.array_equal(turned_alike(left, np.rot90(right, k)), right)
