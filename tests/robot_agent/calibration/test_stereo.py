"""Known rigs are recovered, with deviations that hold; what cannot be right is left out."""

from dataclasses import replace

import numpy as np
import pytest

from fleet.simulation.chessboard import TRIAL_BOARD, TRIAL_RIG
from robot_agent.calibration.fit import fit_rig
from robot_agent.calibration.stereo import Rejected, calibrate
from tagmap.errors import DataError, DegenerateError
from tagmap.geometry import se3

SIZE = (640, 480)
RUNS = 10


def intrinsics(camera):
    return np.array([*camera.focal_px, *camera.centre_px, *camera.dist])


def test_the_rig_is_recovered_with_honest_deviations(make_views):
    """Mean squared errors in deviations, over runs and parameters: 1, within what chance allows."""
    squares = []
    for seed in range(RUNS):
        found = calibrate(make_views(seed), SIZE, TRIAL_BOARD)
        assert found.rejected == []
        assert found.fit.rig.sigma_px == pytest.approx(0.1, rel=0.1)
        rig, sigma = found.fit.rig, found.sigmas
        if not found.fit.fits_k3:
            error = se3.log(se3.inverse(TRIAL_RIG.T_right_left) @ rig.T_right_left)
            parts = [
                (intrinsics(rig.left) - intrinsics(TRIAL_RIG.left))[:8] / sigma.left[:8],
                (intrinsics(rig.right) - intrinsics(TRIAL_RIG.right))[:8] / sigma.right[:8],
                (rig.T_right_left - TRIAL_RIG.T_right_left)[:3, 3] / sigma.p_m,
                error[3:] / sigma.rotation_rad,
            ]
            squares.append(np.concatenate(parts) ** 2)
    assert len(squares) >= RUNS // 2
    # Parameters are correlated, so the band is wider than that of as many independent ones.
    assert 0.6 < np.mean(squares) < 1.6
    assert np.max(squares) < 5.0**2


def test_the_noise_is_told_per_corner_and_per_coordinate(make_views):
    found = calibrate(make_views(1), SIZE, TRIAL_BOARD)
    rms = np.sqrt(np.mean(found.fit.pair_rms_px**2))
    assert found.fit.rms_px == pytest.approx(rms)
    assert found.fit.rms_px == pytest.approx(np.sqrt(2) * found.fit.rig.sigma_px, rel=0.05)
    assert np.allclose(found.fit.camera_rms_px, found.fit.rms_px, rtol=0.1)


def moved(view, px):
    return replace(view, right_px=view.right_px + px)


def test_bad_pairs_are_found_and_named_the_worst_first(make_views):
    views = make_views(2)
    views[4] = moved(views[4], [2.0, 3.0])
    views[7] = moved(views[7], [0.0, 8.0])
    found = calibrate(views, SIZE, TRIAL_BOARD, [Rejected("13", "no board in left13.png")])
    assert [pair.name for pair in found.rejected] == ["13", "08", "05"]
    assert "px, expected at most" in found.rejected[1].reason
    assert len(found.views) == len(found.fit.T_cam_board) == 10
    assert found.baseline_m == pytest.approx(0.12, abs=5 * found.sigmas.baseline_m + 5e-5)


def test_a_few_bad_corners_make_a_bad_pair(make_views):
    views = make_views(3)
    views[0].left_px[:6, 1] += 5.0
    found = calibrate(views, SIZE, TRIAL_BOARD)
    assert [pair.name for pair in found.rejected] == ["01"]


def test_too_few_good_pairs_say_what_became_of_the_others(make_views):
    views = make_views(4, count=5)
    views[3] = moved(views[3], [0.0, 20.0])
    with pytest.raises(
        DataError, match=r"4 good pairs, expected at least 5; left out 04: residual"
    ):
        calibrate(views, SIZE, TRIAL_BOARD)
    with pytest.raises(DataError, match=r"0 good pairs"):
        calibrate([], SIZE, TRIAL_BOARD)


def test_pairs_that_do_not_belong_together(make_views):
    views = make_views(5)
    shuffled = [replace(v, right_px=views[i - 1].right_px) for i, v in enumerate(views)]
    with pytest.raises(DataError, match=r"good pairs|fit no two cameras"):
        calibrate(shuffled, SIZE, TRIAL_BOARD)


def test_boards_that_leave_the_focal_length_open_are_refused(make_views):
    """One and the same view again and again."""
    view = make_views(6)[0]
    rng = np.random.default_rng(0)
    views = [
        replace(
            view, left_px=rng.normal(view.left_px, 0.1), right_px=rng.normal(view.right_px, 0.1)
        )
        for _ in range(6)
    ]
    with pytest.raises((DegenerateError, DataError)):
        calibrate(views, SIZE, TRIAL_BOARD)


def test_a_significant_k3_is_kept(make_views):
    """The trial rig has none; this is what decides."""
    found = [calibrate(make_views(seed), SIZE, TRIAL_BOARD).fit for seed in (7, 8)]
    assert all(fit.rig.left.dist[4] == 0.0 for fit in found if not fit.fits_k3)
    fit = fit_rig(make_views(7), SIZE, TRIAL_BOARD, fits_k3=True)
    assert fit.rig.left.dist[4] != 0.0
