import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tagmap.geometry import se2, se3
from tagmap.geometry.alignment import Alignment, align
from tests.geometry.lie import tangents

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
ROOM = np.array(
    [[0.0, 0.0, 2.5], [5.0, 0.0, 2.5], [5.0, 4.0, 2.4], [0.0, 4.0, 2.5], [0.0, 2.0, 1.0]]
)


@given(tangents(3, batch=()), st.integers(2, 4))
def test_planar_alignment_recovers_the_transform(xi: np.ndarray, n: int) -> None:
    T_b_a = se2.exp(xi)
    found = align(SQUARE[:n], se2.act(T_b_a, SQUARE[:n]))
    assert found.determined
    np.testing.assert_allclose(found.T_b_a, T_b_a, atol=1e-10 * (1.0 + np.abs(xi).max()))
    assert found.rms_m < 1e-10


@given(tangents(6, batch=()), st.integers(3, 5))
def test_spatial_alignment_recovers_the_transform(xi: np.ndarray, n: int) -> None:
    T_b_a = se3.exp(xi)
    found = align(ROOM[:n], se3.act(T_b_a, ROOM[:n]))
    assert found.determined
    np.testing.assert_allclose(found.T_b_a, T_b_a, atol=1e-9 * (1.0 + np.abs(xi).max()))


def test_rms_and_weights() -> None:
    moved = SQUARE + np.array([[0.0, 0.1], [0.0, -0.1], [0.0, 0.1], [0.0, -0.1]])
    assert align(SQUARE, moved).rms_m == pytest.approx(0.1, rel=0.05)
    wrong = np.vstack([SQUARE, [[2.0, 2.0]]])
    target = np.vstack([SQUARE, [[90.0, -70.0]]])
    found = align(wrong, target, weights=np.array([1.0, 1.0, 1.0, 1.0, 0.0]))
    np.testing.assert_allclose(found.T_b_a, np.eye(3), atol=1e-12)


def test_a_mirror_image_is_never_answered_by_a_reflection() -> None:
    found = align(ROOM, ROOM * [1.0, 1.0, -1.0])
    if found.determined:
        assert np.linalg.det(found.T_b_a[:3, :3]) == pytest.approx(1.0)


LINE = np.array([[0.0, 1.0, 2.0], [1.0, 1.5, 2.0], [2.0, 2.0, 2.0], [8.0, 5.0, 2.0]])


@pytest.mark.parametrize(
    ("points", "word"),
    [
        pytest.param(ROOM[:2], "at least 3", id="two points in space"),
        pytest.param(ROOM[:0], "0 points", id="nothing"),
        pytest.param(np.repeat(ROOM[:1], 4, axis=0), "coincide", id="coincident in space"),
        pytest.param(LINE, "one line", id="collinear in space"),
        pytest.param(SQUARE[:1], "at least 2", id="one point in the plane"),
        pytest.param(np.repeat(SQUARE[1:2], 3, axis=0), "coincide", id="coincident in the plane"),
        pytest.param(LINE[:2, :2] * 1e-3, "coincide", id="closer than the noise"),
    ],
)
def test_degenerate_sets_are_flagged_and_never_answered(points: np.ndarray, word: str) -> None:
    found = align(points, points + 1.0, sigma_m=0.01 if word == "coincide" else 0.0)
    _flagged(found, word)


def test_an_almost_straight_line_is_a_line_once_noise_is_considered() -> None:
    bent = LINE + np.array([0.0, 0.0, 0.02]) * np.array([[0.0], [1.0], [0.0], [0.0]])
    assert align(bent, bent).determined
    _flagged(align(bent, bent, sigma_m=0.01), "one line")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1e300])
def test_a_point_whose_square_is_not_finite_is_flagged(bad: float) -> None:
    points = ROOM.copy()
    points[1, 2] = bad
    _flagged(align(points, ROOM), "not finite")
    _flagged(align(ROOM, points), "not finite")


def test_planar_mirror_is_ambiguous() -> None:
    cross = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    _flagged(align(cross, cross * [1.0, -1.0]), "mirror")


def _flagged(found: Alignment, word: str) -> None:
    assert not found.determined
    assert found.missing is not None
    assert word in found.missing
    assert np.isnan(found.T_b_a).all()
