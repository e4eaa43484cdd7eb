"""Coverage: what a robot under a known ceiling can expect."""

import numpy as np
import pytest

from tagmap.localisation.coverage import coverage, heading_and_tilt, visible
from tests.geometry.rigs import PARALLEL, TOED_IN


def test_axis_is_raised_by_the_tilt():
    R = heading_and_tilt(0.5, 0.3)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert R[2, 2] == pytest.approx(np.sin(0.3))
    assert np.arctan2(R[1, 2], R[0, 2]) == pytest.approx(0.5)
    assert R[2, 1] < 0.0


def test_nothing_outside_the_image_is_visible():
    points = np.array([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0], [30.0, 0.0, 3.0], [3.1, 0.0, 3.0]])
    seen = visible(PARALLEL, points)
    np.testing.assert_array_equal(seen, [[1, 1], [0, 0], [0, 0], [1, 1]])
    far = np.array([[x, 0.4 * x, 1.0] for x in np.linspace(3.0, 60.0, 200)])
    assert not visible(TOED_IN, far).any()


def test_better_where_tags_are_nearer_and_none_without_tags():
    grid = np.array([[x, y, 3.0] for x in range(6) for y in range(6)], float)
    low = coverage(PARALLEL, grid, 0.3, np.pi / 2.0, 0.5)
    high = coverage(PARALLEL, grid, 1.3, np.pi / 2.0, 0.5)
    assert low.sigma_m.shape == (10, 10)
    assert np.median(high.sigma_m) < np.median(low.sigma_m)
    down = coverage(PARALLEL, grid, 0.3, -np.pi / 2.0, 0.5)
    assert np.isinf(down.sigma_m).all()


def test_two_tags_cover_nothing():
    pair = np.array([[0.0, 0.0, 3.0], [1.0, 1.0, 3.0]])
    assert np.isinf(coverage(PARALLEL, pair, 0.3, np.pi / 2.0, 0.5).sigma_m).all()
