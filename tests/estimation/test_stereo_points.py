"""Compiled triangulation against the plain one."""

import numpy as np
import pytest

from tagmap.estimation.kernels.stereo_points import triangulate
from tagmap.estimation.packing import lower, rig_numbers
from tagmap.estimation.problem import whitening
from tagmap.geometry import stereo
from tests.geometry.rigs import PARALLEL, TOED_IN, points_in_view

LEAST = 1e-12


def points_and_information(
    rig: stereo.StereoRig, px: np.ndarray, cov: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    k = len(px)
    p_cam, information = np.empty((k, 3)), np.empty((k, 3, 3))
    whiten = lower(whitening(np.broadcast_to(cov, (k, 4, 4))))
    triangulate(rig_numbers(rig), px, whiten, LEAST, p_cam, information)
    return p_cam, information


@pytest.mark.parametrize("rig", [PARALLEL, TOED_IN])
def test_agrees_with_the_plain_one(rig: stereo.StereoRig) -> None:
    rng = np.random.default_rng(4)
    cov = np.diag([0.09, 0.04, 0.16, 0.09]) + 0.02
    px, _ = stereo.project(rig, points_in_view(rng, (300,)))
    px += rng.multivariate_normal(np.zeros(4), cov, size=300)
    p_cam, information = points_and_information(rig, px, cov)
    expected, cov_cam, _ = stereo.triangulate(rig, px, np.broadcast_to(cov, (300, 4, 4)))
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(p_cam, expected, rtol=1e-9, atol=1e-9)
    exact = np.linalg.inv(cov_cam)
    size = np.trace(exact, axis1=1, axis2=2)[:, None, None]
    np.testing.assert_allclose(information / size, exact / size, atol=1e-6)


def test_rays_that_do_not_meet_in_front_give_nothing() -> None:
    crossed = np.array([600.0, 400.0, 640.0, 400.0])
    parallel = np.array([640.0, 400.0, 640.0, 400.0])
    fine, _ = stereo.project(PARALLEL, np.array([0.0, 0.0, 5.0]))
    p_cam, _ = points_and_information(PARALLEL, np.stack([crossed, parallel, fine]), np.eye(4))
    assert np.isnan(p_cam[:2]).all()
    np.testing.assert_allclose(p_cam[2], [0.0, 0.0, 5.0], atol=1e-9)
