from dataclasses import replace

import numpy as np
import pytest

from fleet.replay.planar_odometry import Commands, PlanarOdometryNoise, steps
from tagmap.geometry import se2

WALK = PlanarOdometryNoise(v_scale_sigma=0.0, w_scale_sigma=0.0)
S = 1_000_000_000


def commands(t_s: list[float], v: list[float], w: list[float], **more: int) -> Commands:
    t_ns = np.rint(np.array(t_s) * S).astype(np.int64)
    return Commands(t_ns, np.array(v), np.array(w), **more)


def test_arc_is_exact():
    """A quarter circle of radius 1 m, in one command."""
    moved = steps(
        commands([0.0], [np.pi / 2], [np.pi / 2]), np.array([0, S]), PlanarOdometryNoise()
    )
    np.testing.assert_allclose(
        moved.T_prev_cur[0], se2.from_p_theta(np.array([1.0, 1.0]), np.pi / 2), atol=1e-12
    )


def test_steps_compose_to_the_whole():
    rng = np.random.default_rng(3)
    noise = replace(WALK, floor_m=0.0, floor_rad=0.0)
    drive = commands(np.sort(rng.uniform(0, 10, 200)).tolist(), *rng.normal(size=(2, 200)).tolist())
    t_ns = drive.t_ns[::7]
    parts, whole = steps(drive, t_ns, noise), steps(drive, t_ns[[0, -1]], noise)
    T = np.eye(3)
    cov = np.zeros((3, 3))
    for step, step_cov in zip(parts.T_prev_cur, parts.cov, strict=True):
        carry = se2.adjoint(se2.inverse(step))
        cov = carry @ cov @ carry.T + step_cov
        T = T @ step
    np.testing.assert_allclose(T, whole.T_prev_cur[0], atol=1e-9)
    np.testing.assert_allclose(cov, whole.cov[0], atol=1e-12)


def test_covariance_agrees_with_monte_carlo():
    """Straight for 4 s in 400 arcs; heading noise turns into lateral noise at the end."""
    noise = replace(WALK, floor_m=0.0, floor_rad=0.0)
    n, runs = 400, 4000
    moved = steps(
        commands([0.01 * k for k in range(n)], [0.1] * n, [0.0] * n), np.array([0, 4 * S]), noise
    )
    sigma = 0.1 * np.array(
        [noise.forward_m_per_sqrt_s, noise.lateral_m_per_sqrt_s, noise.heading_rad_per_sqrt_s]
    )
    rng = np.random.default_rng(5)
    T = np.broadcast_to(np.eye(3), (runs, 3, 3))
    for _ in range(n):
        T = T @ se2.exp(np.array([0.001, 0.0, 0.0])) @ se2.exp(sigma * rng.normal(size=(runs, 3)))
    delta = se2.log(se2.inverse(moved.T_prev_cur[0]) @ T)
    np.testing.assert_allclose(np.cov(delta.T), moved.cov[0], rtol=0.15, atol=2e-5)


def test_standing_still_is_nearly_certain():
    noise = WALK
    drive = commands([0.0, 1.0], [0.1, 0.0], [0.0, 0.0])
    cov = steps(drive, np.array([0, S, 2 * S]), noise).cov
    assert cov[1, 2, 2] < 0.1 * cov[0, 2, 2]
    assert cov[1, 0, 0] >= noise.floor_m**2


@pytest.mark.parametrize(("t_s", "known"), [(0.5, True), (2.5, False)])
def test_commands_do_not_hold_for_ever(t_s: float, known: bool):
    drive = commands([0.0], [0.1], [0.0], hold_ns=2 * S)
    assert steps(drive, np.array([0, int(t_s * S)]), PlanarOdometryNoise()).known[0] == known


def test_before_the_first_command_the_robot_stands():
    drive = commands([1.0], [1.0], [0.0])
    moved = steps(drive, np.array([0, 2 * S]), PlanarOdometryNoise())
    np.testing.assert_allclose(moved.T_prev_cur[0, :2, 2], [1.0, 0.0], atol=1e-12)


def test_scale_errors_are_those_of_a_drive_at_another_scale():
    """A winding drive, commanded 1 % faster and turning 1 % more, to first order."""
    rng = np.random.default_rng(8)
    v, w = rng.uniform(0.05, 0.15, 100), rng.uniform(-0.5, 0.5, 100)
    t_s, t_ns = (0.1 * np.arange(100)).tolist(), np.array([0, 10 * S])
    none = PlanarOdometryNoise(0.0, 0.0, 0.0, floor_m=0.0, floor_rad=0.0)
    stated = steps(
        commands(t_s, v.tolist(), w.tolist()),
        t_ns,
        replace(none, v_scale_sigma=0.01, w_scale_sigma=0.01),
    )
    cov = np.zeros((3, 3))
    for v_scale, w_scale in ((1.01, 1.0), (1.0, 1.01)):
        drive = commands(t_s, (v_scale * v).tolist(), (w_scale * w).tolist())
        T = steps(drive, t_ns, none).T_prev_cur[0]
        delta = se2.log(se2.inverse(stated.T_prev_cur[0]) @ T)
        cov += np.outer(delta, delta)
    np.testing.assert_allclose(stated.cov[0], cov, rtol=0.05, atol=1e-7)
