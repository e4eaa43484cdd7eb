"""The thesis's way with two images, and with one: exact where nothing is noisy."""

import numpy as np
import pytest

from fleet.thesis.dilution import angle
from fleet.thesis.imaging import look, middle_m, thesis_rig
from fleet.thesis.methods import left_rays, pose_of, reconstruct, single_image
from fleet.thesis.setting import circle, peak_tilt_deg, triangle
from tagmap.errors import DegenerateError
from tagmap.geometry import se3, stereo
from tagmap.localisation.coverage import visible

T_MAP_CAM = circle(1.5, 30.0)[3]
P_MAP = triangle(0.15)
ASIDE = np.array([0.05, 0.0, 0.0])
P_CAM = se3.act(se3.inverse(T_MAP_CAM), P_MAP) - ASIDE
PAIR = np.array([[-0.2, 0.0, 0.0], [0.2, 0.1, 0.0]]) + middle_m(3.0)


def test_reconstruction_is_exact():
    px, _ = stereo.project(thesis_rig(), P_CAM)
    np.testing.assert_allclose(reconstruct(thesis_rig(), px), P_CAM, atol=1e-9)


def test_one_image_and_known_tags_give_the_same():
    px, _ = stereo.project(thesis_rig(), P_CAM)
    rays = left_rays(thesis_rig(), px)
    start = np.linalg.norm(P_CAM, axis=-1) + 1e-3
    np.testing.assert_allclose(single_image(rays, P_MAP, start), P_CAM, atol=1e-9)


def test_the_pose_of_relative_positions():
    pose = pose_of(P_CAM + ASIDE, P_MAP)
    np.testing.assert_allclose(pose.p_map_cam, T_MAP_CAM[:3, 3], atol=1e-9)
    assert angle(pose.axis, T_MAP_CAM[:3, 2]) < 1e-9


def test_collinear_tags_have_no_pose():
    line = np.arange(3.0)[:, None] * np.array([0.1, 0.0, 0.0])
    with pytest.raises(DegenerateError):
        pose_of(line + np.array([0.0, 0.0, 1.0]), line)


def test_cameras_look_at_the_middle_from_everywhere():
    T = circle(2.0, 25.0)
    np.testing.assert_allclose(np.linalg.norm(T[:, :3, 3], axis=-1), 2.0)
    np.testing.assert_allclose(T[:, :3, 2], -T[:, :3, 3] / 2.0, atol=1e-12)
    np.testing.assert_allclose(-T[:, 2, 2], np.cos(np.deg2rad(25.0)))
    assert peak_tilt_deg(3.0, 2.0) is None


def test_both_ways_find_the_spots_of_an_image():
    seen = look(np.random.default_rng(0), thesis_rig(), PAIR, 3.0, 3.0)
    true, _ = stereo.project(thesis_rig(), PAIR)
    assert seen.complete
    np.testing.assert_allclose(seen.ours_px, true, atol=0.05)
    np.testing.assert_allclose(seen.thesis_px, true, atol=0.2)
    np.testing.assert_allclose(seen.cov, seen.bound, atol=2e-5)


def test_a_spot_too_faint_is_not_found():
    seen = look(np.random.default_rng(0), thesis_rig(), PAIR, 300.0, 3.0)
    assert not seen.complete
    assert np.isnan(seen.thesis_px).all()


@pytest.mark.parametrize("z_m", [1.2, 2.4, 5.0, 8.0])
def test_the_middle_is_that_of_what_both_cameras_see(z_m):
    rig, x = thesis_rig(), np.linspace(-3.0, 3.0, 6001)
    p = np.stack([x, 0.0 * x, np.full_like(x, z_m)], axis=-1)
    both = visible(rig, p).all(axis=-1)
    assert middle_m(z_m)[0] == pytest.approx(x[both].mean(), abs=0.02)
