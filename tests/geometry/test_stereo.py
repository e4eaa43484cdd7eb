import numpy as np
import pytest

from tagmap.geometry import stereo
from tests.geometry.rigs import PARALLEL, TOED_IN, central_differences, points_in_view


def test_disparity_is_focal_length_times_baseline_over_depth() -> None:
    px, _ = stereo.project(PARALLEL, np.array([0.3, -0.2, 4.0]))
    np.testing.assert_allclose(px[0] - px[2], 600.0 * 0.2 / 4.0)
    np.testing.assert_allclose(px[1], px[3])


@pytest.mark.parametrize("rig", [PARALLEL, TOED_IN])
@pytest.mark.parametrize("shape", [(), (0,), (7,), (2, 3)])
def test_jacobian_by_central_differences(rig: stereo.StereoRig, shape: tuple[int, ...]) -> None:
    points = points_in_view(np.random.default_rng(1), shape)
    px, J = stereo.project(rig, points)
    assert px.shape == (*shape, 4)
    numerical = central_differences(lambda p: stereo.project(rig, p)[0], points, 1e-6)
    np.testing.assert_allclose(J, numerical, atol=1e-5)


@pytest.mark.parametrize("rig", [PARALLEL, TOED_IN])
@pytest.mark.parametrize("shape", [(), (0,), (50,), (2, 3)])
def test_triangulation_inverts_projection(rig: stereo.StereoRig, shape: tuple[int, ...]) -> None:
    points = points_in_view(np.random.default_rng(2), shape)
    px, _ = stereo.project(rig, points)
    p_cam, _, chi2 = stereo.triangulate(rig, px, 0.09 * np.eye(4))
    np.testing.assert_allclose(p_cam, points, atol=1e-8)
    np.testing.assert_allclose(chi2, 0.0, atol=1e-12)


def test_depth_sigma_is_the_textbook_one() -> None:
    """Independent pixels of equal noise: sigma_z = z^2 sqrt(2) sigma_px / (f b)."""
    px, _ = stereo.project(PARALLEL, np.array([0.0, 0.0, 5.0]))
    _, cov, _ = stereo.triangulate(PARALLEL, px, 0.3**2 * np.eye(4))
    assert np.sqrt(cov[2, 2]) == pytest.approx(25.0 * np.sqrt(2.0) * 0.3 / (600.0 * 0.2))
    assert np.sqrt(cov[1, 1]) == pytest.approx(5.0 * 0.3 / np.sqrt(2.0) / 600.0)


def test_covariance_and_chi2_hold_in_monte_carlo() -> None:
    rng = np.random.default_rng(3)
    cov_px = np.diag([0.09, 0.04, 0.16, 0.09]) + 0.02
    truth = np.array([0.5, -0.3, 3.0])
    px, _ = stereo.project(TOED_IN, truth)
    noisy = px + rng.multivariate_normal(np.zeros(4), cov_px, size=20000)
    p_cam, cov, chi2 = stereo.triangulate(TOED_IN, noisy, cov_px)
    sample = np.cov(p_cam.T)
    np.testing.assert_allclose(sample, cov.mean(axis=0), rtol=0.06, atol=0.02 * sample.max())
    nees = np.einsum("ni,nij,nj->n", p_cam - truth, np.linalg.inv(cov), p_cam - truth)
    assert nees.mean() == pytest.approx(3.0, abs=0.1)
    assert chi2.mean() == pytest.approx(1.0, abs=0.05)


def test_rays_that_do_not_meet_in_front_give_nothing() -> None:
    crossed = np.array([600.0, 400.0, 640.0, 400.0])
    parallel = np.array([640.0, 400.0, 640.0, 400.0])
    fine, _ = stereo.project(PARALLEL, np.array([0.0, 0.0, 5.0]))
    pixels = np.stack([crossed, parallel, fine])
    p_cam, cov, chi2 = stereo.triangulate(PARALLEL, pixels, 0.09 * np.eye(4))
    for values in (p_cam.sum(-1), cov.sum((-1, -2)), chi2):
        assert np.isnan(values).tolist() == [True, True, False]
