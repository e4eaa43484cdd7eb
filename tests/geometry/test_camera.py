import cv2
import numpy as np
import pytest

from tagmap.geometry import camera
from tests.geometry.rigs import IDEAL, LEFT, central_differences, points_in_view

MATRIX = np.array([[LEFT.fx_px, 0.0, LEFT.cx_px], [0.0, LEFT.fy_px, LEFT.cy_px], [0, 0, 1.0]])


def test_the_axis_meets_the_principal_point() -> None:
    px, _ = camera.project(IDEAL, np.array([0.0, 0.0, 5.0]))
    np.testing.assert_array_equal(px, [639.5, 399.5])
    px, _ = camera.project(IDEAL, np.array([1.0, -0.5, 5.0]))
    np.testing.assert_allclose(px, [639.5 + 120.0, 399.5 - 60.0])


def test_projection_agrees_with_opencv() -> None:
    points = points_in_view(np.random.default_rng(1), (200,))
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), MATRIX, LEFT.dist)
    px, _ = camera.project(LEFT, points)
    np.testing.assert_allclose(px, expected[:, 0], atol=1e-9)


@pytest.mark.parametrize("shape", [(), (0,), (7,), (2, 3)])
def test_jacobian_by_central_differences(shape: tuple[int, ...]) -> None:
    points = points_in_view(np.random.default_rng(2), shape)
    px, J = camera.project(LEFT, points)
    assert px.shape == (*shape, 2)
    numerical = central_differences(lambda p: camera.project(LEFT, p)[0], points, 1e-6)
    np.testing.assert_allclose(J, numerical, atol=1e-5)


@pytest.mark.parametrize("model", [LEFT, IDEAL])
def test_undistort_inverts_projection(model: camera.Camera) -> None:
    points = points_in_view(np.random.default_rng(3), (300,))
    px, _ = camera.project(model, points)
    ray = camera.undistort(model, px)
    np.testing.assert_allclose(ray, points[:, :2] / points[:, 2:], atol=1e-9)


def test_points_not_in_front_are_not_measured() -> None:
    points = np.array([[0.1, 0.2, 0.0], [0.1, 0.2, -3.0], [0.1, 0.2, 3.0]])
    px, J = camera.project(LEFT, points)
    assert np.isnan(px).all(axis=-1).tolist() == [True, True, False]
    assert np.isnan(J).all(axis=(-1, -2)).tolist() == [True, True, False]


def test_pixels_beyond_the_fold_of_the_distortion_have_no_ray() -> None:
    barrel = camera.Camera(1280, 800, 600.0, 600.0, 639.5, 399.5, np.array([-0.4, 0, 0, 0, 0]))
    ray = camera.undistort(barrel, np.array([[639.5 + 900.0, 399.5], [639.5 + 60.0, 399.5]]))
    assert np.isnan(ray).all(axis=-1).tolist() == [True, False]
