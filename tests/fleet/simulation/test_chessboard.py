import numpy as np

from fleet.simulation.chessboard import (
    BLACK,
    TRIAL_BOARD,
    TRIAL_RIG,
    WALL,
    WHITE,
    Eye,
    Imaging,
    poses,
)
from tagmap.geometry import se3
from tagmap.geometry.camera import project
from tagmap.geometry.stereo import project as project_stereo

PERFECT = Imaging(blur_px=0.0, noise=0.0)


def test_squares_are_where_the_forward_model_has_them():
    T_cam_board = poses(np.random.default_rng(1), 1)[0]
    image = Eye(TRIAL_RIG.left).see(TRIAL_BOARD, T_cam_board, PERFECT, np.random.default_rng(0))
    middle = TRIAL_BOARD.square_m * np.array([0.5, 0.5, 0.0])
    px, _ = project(TRIAL_RIG.left, se3.act(T_cam_board, TRIAL_BOARD.points + middle))
    u, v = np.rint(px).astype(int).T
    j, i = np.divmod(np.arange(len(px)), TRIAL_BOARD.cols)
    assert np.array_equal(image[v, u], np.where((i + j) % 2 == 0, BLACK, WHITE))
    assert image[0, 0] == WALL


def test_images_repeat_and_noise_is_as_stated():
    T_cam_board = poses(np.random.default_rng(1), 1)[0]
    eye = Eye(TRIAL_RIG.left)
    exact = eye.see(TRIAL_BOARD, T_cam_board, PERFECT, np.random.default_rng(0))
    noisy = [
        eye.see(TRIAL_BOARD, T_cam_board, Imaging(0.0, 3.0), np.random.default_rng(7))
        for _ in range(2)
    ]
    assert np.array_equal(*noisy)
    assert abs(np.std(noisy[0].astype(float) - exact) - 3.0) < 0.1


def test_boards_are_whole_in_both_images():
    T_cam_board = poses(np.random.default_rng(2), 20)
    px, _ = project_stereo(TRIAL_RIG, se3.act(T_cam_board[:, None], TRIAL_BOARD.points))
    assert px.min() > 0.0
    assert (px < [639.0, 479.0, 639.0, 479.0]).all()
