"""The two-mirror model against mirrors that are planes in space, and its inverse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial.transform import Rotation

from tagmap.geometry.scanner.inverse import angles_to
from tagmap.geometry.scanner.mirrors import PARAMETERS, Mirrors, beam
from tagmap.geometry.scanner.miss import miss
from tagmap.geometry.scanner.scanner import Scanner, point
from tests.geometry.rigs import central_differences
from tests.geometry.scanners import IDEAL, SCANNER, SKEWED, targets

THETA = np.random.default_rng(1).uniform(-0.35, 0.35, (40, 2))


def reflected(p, n, on_mirror, normal):
    """A ray, point and direction, from a plane mirror."""
    hit = p + n * ((on_mirror - p) @ normal / (n @ normal))
    return hit, n - 2.0 * (n @ normal) * normal


def by_planes(mirrors: Mirrors, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The beam from where each mirror is in space: turn its plane, meet it, reflect, twice."""
    above = np.array([0.0, 0.0, mirrors.separation_m])
    axis_x = Rotation.from_euler("z", mirrors.skew_rad).apply([0.0, 1.0, 0.0])
    turns = Rotation.from_rotvec((theta[0] - mirrors.neutral_1_rad) * axis_x)
    normal_x = turns.apply([0.0, 0.0, -1.0])
    normal_y = Rotation.from_euler("x", theta[1] - mirrors.neutral_2_rad).apply([0.0, 0.0, 1.0])
    angles = [mirrors.incident_yaw_rad, mirrors.incident_pitch_rad]
    n = Rotation.from_euler("zy", angles).apply([-1.0, 0.0, 0.0])
    p = above + np.array([0.0, mirrors.incident_y_m, mirrors.incident_z_m])
    p, n = reflected(p, n, above, normal_x)
    return reflected(p, n, np.zeros(3), normal_y)


@pytest.mark.parametrize("mirrors", [IDEAL, SKEWED])
def test_the_beam_is_that_of_two_plane_mirrors(mirrors: Mirrors) -> None:
    found = beam(mirrors, THETA)
    expected = [by_planes(mirrors, theta) for theta in THETA]
    np.testing.assert_allclose(found.start, [p for p, _ in expected], atol=1e-15)
    np.testing.assert_allclose(found.direction, [n for _, n in expected], atol=1e-14)


def test_the_ideal_scanner_is_the_simplified_model() -> None:
    """Thesis, eq. 5.29 and 5.30."""
    x, y = 2.0 * THETA.T
    zero = np.zeros_like(x)
    direction = np.stack([-np.tan(x), np.cos(y), np.sin(y)], axis=-1)
    found = beam(IDEAL, THETA)
    np.testing.assert_allclose(
        found.start, np.stack([-0.015 * np.tan(x), zero, zero], axis=-1), atol=1e-16
    )
    np.testing.assert_allclose(
        found.direction * np.linalg.norm(direction, axis=-1, keepdims=True), direction, atol=1e-14
    )


@pytest.mark.parametrize("mirrors", [IDEAL, SKEWED])
def test_jacobians_by_central_differences(mirrors: Mirrors) -> None:
    p_laser = np.array([0.6, 4.0, -0.5]) + np.random.default_rng(2).normal(0.0, 0.5, (40, 3))

    def everything(x: np.ndarray) -> np.ndarray:
        found = [
            np.concatenate([ray.start, ray.direction, there.off])
            for row, p in zip(x, p_laser, strict=True)
            for ray in [beam(Mirrors(*row[2:]), row[:2])]
            for there in [miss(Mirrors(*row[2:]), row[:2], p)]
        ]
        return np.stack(found)

    x = np.concatenate([THETA, np.tile(mirrors.values, (40, 1))], axis=-1)
    ray, there = beam(mirrors, THETA), miss(mirrors, THETA, p_laser)
    J_off = np.concatenate([there.by_theta, there.by_mirrors], axis=-1)
    J = np.concatenate([ray.start_by, ray.direction_by, J_off], axis=-2)
    np.testing.assert_allclose(J, central_differences(everything, x, 1e-6), atol=1e-8)
    by_point = central_differences(lambda p: miss(mirrors, THETA, p).off, p_laser, 1e-6)
    np.testing.assert_allclose(there.by_point, by_point, atol=1e-8)


def test_jacobians_by_the_scanner_and_by_points_in_cam() -> None:
    p_cam = targets(np.random.default_rng(3), (40,))
    there = point(SCANNER, THETA, p_cam)

    def moved(delta: np.ndarray) -> np.ndarray:
        return np.stack(
            [point(SCANNER.moved(d), t, p).off for d, t, p in zip(delta, THETA, p_cam, strict=True)]
        )

    numerical = central_differences(moved, np.zeros((40, 12)), 1e-6)
    np.testing.assert_allclose(there.by_scanner, numerical, atol=1e-7)
    by_point = central_differences(lambda p: point(SCANNER, THETA, p).off, p_cam, 1e-6)
    np.testing.assert_allclose(there.by_point, by_point, atol=1e-8)


def test_off_is_the_distance_from_the_beam() -> None:
    p_laser = np.random.default_rng(4).normal([0.0, 5.0, 0.0], 0.5, (40, 3))
    ray, there = beam(SKEWED, THETA), miss(SKEWED, THETA, p_laser)
    distance = np.linalg.norm(np.cross(p_laser - ray.start, ray.direction), axis=-1)
    np.testing.assert_allclose(np.linalg.norm(there.off, axis=-1), distance, atol=1e-13)
    np.testing.assert_allclose(
        there.ahead, ((p_laser - ray.start) * ray.direction).sum(-1), atol=1e-13
    )


def test_two_parameters_are_pure_gauge() -> None:
    """Of 14 unknowns beams determine 12; with the neutral angles fixed nothing else is open."""
    p_cam = targets(np.random.default_rng(5), (200,))
    everything = Scanner(SKEWED, SCANNER.T_cam_laser, PARAMETERS, np.eye(14))
    for scanner, determined in ((everything, 12), (SCANNER, 12)):
        J = point(scanner, np.tile(THETA, (5, 1)), p_cam).by_scanner.reshape(400, -1)
        values = np.linalg.svd(J / np.linalg.norm(J, axis=0), compute_uv=False)
        assert (values > 1e-12 * values[0]).sum() == determined


@given(
    arrays.arrays(np.float64, 8, elements=st.floats(-1.0, 1.0)),
    st.floats(-0.25, 0.25), st.floats(-0.25, 0.25), st.floats(0.3, 50.0),
)  # fmt: skip
def test_the_inverse_hits_the_target(units, theta_1, theta_2, range_m) -> None:
    spread = np.array([0.01, 0.05, 0.05, 0.05, 0.005, 0.005, 0.05, 0.05])
    mirrors = Mirrors(*(IDEAL.values + spread * units))
    theta = np.array([theta_1, theta_2])
    ray = beam(mirrors, theta)
    found = angles_to(mirrors, ray.start + range_m * ray.direction)
    np.testing.assert_allclose(found, theta, atol=1e-11)


@pytest.mark.parametrize("shape", [(), (0,), (7,), (2, 3)])
def test_the_inverse_is_batched(shape: tuple[int, ...]) -> None:
    p_laser = np.random.default_rng(6).normal([0.0, 5.0, 0.0], 0.7, (*shape, 3))
    theta = angles_to(SKEWED, p_laser)
    assert theta.shape == (*shape, 2)
    there = miss(SKEWED, theta, p_laser)
    np.testing.assert_allclose(there.off, 0.0, atol=1e-12)
    assert (there.ahead > 0.0).all()


def test_the_inverse_aims_at_points_not_directions() -> None:
    """Targets on one ray from the origin need different angles: there is no single centre."""
    ray = np.array([0.3, 1.0, 0.2])
    theta = angles_to(IDEAL, np.array([[2.0], [8.0]]) * ray)
    assert abs(theta[0, 0] - theta[1, 0]) > 1e-4


def test_no_beam_goes_behind_or_through_the_scanner() -> None:
    nowhere = np.array([[0.0, -1.0, -5.0], [0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [np.nan, 1.0, 0.0]])
    assert np.isnan(angles_to(IDEAL, nowhere)).all()


def test_a_mirror_edge_on_gives_no_beam() -> None:
    edge_on = np.array([[0.8, 0.0], [0.0, -0.8], [0.0, 0.0]])
    found = beam(IDEAL, edge_on)
    assert np.isnan(found.direction).all(axis=-1).tolist() == [True, True, False]
