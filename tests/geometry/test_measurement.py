from math import atan2, pi, radians

import numpy as np
import pytest

from tagmap.conventions import Form, Kind
from tagmap.geometry import measurement
from tests.geometry.rigs import TOED_IN, central_differences, points_in_view

FORMS: list[tuple[Kind, Form]] = [
    (kind, form) for kind, widths in measurement.FORM_WIDTH.items() for form in widths
]


def _points(kind: Kind, shape: tuple[int, ...]) -> np.ndarray:
    rng = np.random.default_rng(5)
    if kind == "spatial":
        return points_in_view(rng, shape)
    return rng.uniform(-5.0, 5.0, size=(*shape, 2))


@pytest.mark.parametrize("shape", [(), (0,), (9,), (2, 3)])
@pytest.mark.parametrize(("kind", "form"), FORMS)
def test_jacobian_by_central_differences(kind: Kind, form: Form, shape: tuple[int, ...]) -> None:
    p_cam = _points(kind, shape)
    z, J = measurement.predict(form, kind, p_cam, TOED_IN)
    assert z.shape == (*shape, measurement.FORM_WIDTH[kind][form])
    numerical = central_differences(
        lambda p: measurement.predict(form, kind, p, TOED_IN)[0], p_cam, 1e-6
    )
    np.testing.assert_allclose(J, numerical, atol=1e-5)


@pytest.mark.parametrize(("kind", "form"), FORMS)
def test_at_truth_the_residual_is_zero_and_the_point_comes_back(kind: Kind, form: Form) -> None:
    p_cam = _points(kind, (6,))
    z, _ = measurement.predict(form, kind, p_cam, TOED_IN)
    np.testing.assert_allclose(measurement.residual(form, kind, z, z), 0.0)
    cov = np.broadcast_to(1e-4 * np.eye(z.shape[-1]), (*z.shape, z.shape[-1]))
    point = measurement.to_point(form, kind, z, cov, TOED_IN)
    if form == "mono_px" or (kind, form) == ("spatial", "range_bearing"):
        assert point is None
    else:
        assert point is not None
        np.testing.assert_allclose(point[0], p_cam, atol=1e-8)


def test_bearings_are_positive_to_the_left() -> None:
    ahead_left = np.array([4.0, 3.0])
    z, _ = measurement.predict("range_bearing", "planar", ahead_left, None)
    np.testing.assert_allclose(z, [5.0, atan2(3.0, 4.0)])
    z, _ = measurement.predict("range_bearing", "spatial", np.array([-3.0, 1.0, 4.0]), None)
    np.testing.assert_allclose(z, [np.sqrt(26.0), atan2(3.0, 4.0)])


def test_bearings_either_side_of_behind_are_close() -> None:
    left, right = np.array([2.0, radians(179.0)]), np.array([2.0, radians(-179.0)])
    difference = measurement.residual("range_bearing", "planar", left, right)
    np.testing.assert_allclose(difference, [0.0, radians(2.0)])


def test_polar_covariance_is_wide_across_the_ray_and_thin_along_it() -> None:
    z = np.array([10.0, pi / 2])
    point = measurement.to_point("range_bearing", "planar", z, np.diag([0.01, 0.0004]), None)
    assert point is not None
    np.testing.assert_allclose(point[0], [0.0, 10.0], atol=1e-12)
    np.testing.assert_allclose(point[1], np.diag([100.0 * 0.0004, 0.01]), atol=1e-12)


@pytest.mark.parametrize("kind", ["spatial", "planar"])
def test_the_origin_has_no_bearing(kind: Kind) -> None:
    z, J = measurement.predict("range_bearing", kind, np.zeros(3 if kind == "spatial" else 2), None)
    assert np.isnan(z[1])
    assert np.isnan(J).any()


@pytest.mark.parametrize("form", measurement.PIXEL_FORMS)
def test_pixels_need_a_rig_and_space(form: Form) -> None:
    with pytest.raises(ValueError, match="without a rig"):
        measurement.predict(form, "spatial", np.ones(3), None)
    with pytest.raises(ValueError, match="expected a spatial one"):
        measurement.predict(form, "planar", np.ones(2), TOED_IN)
