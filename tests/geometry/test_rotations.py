"""Quaternions, headings and the small-angle quotients."""

from fractions import Fraction
from math import factorial, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tagmap.geometry import se2, se3, small_angle, so3
from tagmap.geometry.kernels import lie
from tests.geometry.lie import ANGLES_RAD, tangents


def test_a_quarter_turn_to_the_left_looks_along_y() -> None:
    T = se3.from_p_q(np.zeros(3), np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]))
    np.testing.assert_allclose(se3.act(T, np.array([1.0, 0.0, 0.0])), [0.0, 1.0, 0.0], atol=1e-15)
    T = se2.from_p_theta(np.array([5.0, 0.0]), pi / 2)
    np.testing.assert_allclose(se2.act(T, np.array([1.0, 0.0])), [5.0, 1.0], atol=1e-15)


@given(tangents(6, max_angle_rad=pi))
def test_quaternion_round_trip_keeps_the_transform_and_w_positive(xi: np.ndarray) -> None:
    T = se3.exp(xi)
    p, q = se3.to_p_q(T)
    assert (q[..., 0] >= 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-15)
    np.testing.assert_allclose(se3.from_p_q(p, q), T, atol=1e-14)
    np.testing.assert_allclose(se3.from_p_q(p, -q), T, atol=1e-14)


@given(tangents(6))
def test_one_pose_in_plain_numbers_is_as_in_a_batch(xi: np.ndarray) -> None:
    for T in se3.exp(xi).reshape(-1, 4, 4):
        p, q_wxyz = se3.one_to_p_q(T)
        np.testing.assert_allclose(np.array(p), se3.to_p_q(T)[0])
        np.testing.assert_allclose(np.array(q_wxyz), se3.to_p_q(T)[1], atol=1e-12)
        np.testing.assert_allclose(se3.one_from_p_q(p, [3.0 * x for x in q_wxyz]), T, atol=1e-12)


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3), [0.6, 0.0, -0.8], [-0.48, 0.6, 0.64]])
def test_log_at_pi_is_a_half_turn_about_the_axis(axis: list[float]) -> None:
    omega = so3.log(so3.exp(pi * np.asarray(axis)))
    assert np.linalg.norm(omega) == pytest.approx(pi)
    assert abs(omega @ axis) == pytest.approx(pi)


@given(st.floats(-20.0, 20.0), st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)))
def test_headings_wrap(theta: float, p: tuple[float, float]) -> None:
    position, heading = se2.to_p_theta(se2.from_p_theta(np.array(p), theta))
    np.testing.assert_array_equal(position, p)
    assert -pi <= heading <= pi
    assert se2.wrap(heading - theta) == pytest.approx(0.0, abs=1e-13)
    assert np.cos(se2.wrap(np.array(theta))) == pytest.approx(np.cos(theta), abs=1e-13)


def _taylor(coefficient: object, t: float) -> float:
    """Sum of coefficient(k) t^(2 k) in exact arithmetic."""
    square = Fraction(t) ** 2
    return float(sum(coefficient(k) * square**k for k in range(25)))  # type: ignore[operator]


SERIES = {
    "sine_quotient": lambda k: Fraction((-1) ** k, factorial(2 * k + 1)),
    "cosine_quotient": lambda k: Fraction((-1) ** k, factorial(2 * k + 2)),
    "sine_remainder": lambda k: Fraction((-1) ** k, factorial(2 * k + 3)),
    "cosine_remainder": lambda k: Fraction((-1) ** k, factorial(2 * k + 4)),
    "mixed_remainder": lambda k: Fraction((-1) ** k * (k + 1), factorial(2 * k + 5)),
}


COMPILED = ("sine_quotient", "cosine_quotient", "sine_remainder")


@pytest.mark.parametrize("angle_rad", ANGLES_RAD)
@pytest.mark.parametrize("name", SERIES)
def test_quotients_equal_their_exact_series(name: str, angle_rad: float) -> None:
    value = getattr(small_angle, name)(np.array(angle_rad))
    assert value == pytest.approx(_taylor(SERIES[name], angle_rad), rel=2e-13)


@pytest.mark.parametrize("angle_rad", ANGLES_RAD)
@pytest.mark.parametrize("name", COMPILED)
def test_compiled_quotients_equal_their_exact_series(name: str, angle_rad: float) -> None:
    value = getattr(lie, name)(float(angle_rad))
    assert value == pytest.approx(_taylor(SERIES[name], angle_rad), rel=2e-13)


@pytest.mark.parametrize("angle_rad", ANGLES_RAD)
def test_cotangent_remainder_from_the_exact_sine_and_cosine(angle_rad: float) -> None:
    half = angle_rad / 2
    sine = _taylor(SERIES["sine_quotient"], half)
    # 1 - x cot(x) = (sin(x)/x - cos(x)) / (sin(x)/x), and sin(x)/x - cos(x) has its own series.
    difference = _taylor(lambda k: Fraction((-1) ** k * (2 * k + 2), factorial(2 * k + 3)), half)
    expected = pytest.approx(difference / sine / 4, rel=2e-13)
    assert small_angle.cotangent_remainder(np.array(angle_rad)) == expected
    assert lie.cotangent_remainder(float(angle_rad)) == expected
