"""Hits tighten a calibration, and a mount that turns is warned of before a beam misses."""

import numpy as np
import pytest

from fleet.evaluation.aim import aim_error_m
from fleet.simulation import scanning
from fleet.simulation.scanning import (
    NOISE,
    SIGMA_MIDDLE_M,
    TAG_RADIUS_M,
    hit_of,
    misses,
    seen,
    true_angles,
    turned,
)
from robot_agent.calibration.scanner.calibration import calibrate
from robot_agent.calibration.scanner.online import Hit, Online, absorb, begin, reseat, warning
from robot_agent.calibration.scanner.probing import line, middle, sigma_middle_m
from tagmap.geometry.scanner.aiming import beside
from tagmap.geometry.scanner.scanner import Scanner, point

AXIS = np.array([0.6, 0.3, 0.74])
"""About which the mount turns, in laser."""


def calibrated(seed: int) -> tuple[Scanner, Online, np.random.Generator]:
    """The truth, and a calibration by 30 random samples."""
    rng = np.random.default_rng(seed)
    truth = scanning.built(rng)
    samples = scanning.sampled(truth, scanning.anywhere(rng, 30), rng)
    return truth, begin(calibrate("full", samples, NOISE).scanner), rng


def after(state: Online, truth: Scanner, hits: int, rng: np.random.Generator) -> Online:
    for _ in range(hits):
        state = absorb(state, hit_of(truth, *seen(rng), rng))
    return state


def targets_at(depth_m: float) -> np.ndarray:
    return scanning.anywhere(np.random.default_rng(1), 200, (depth_m, depth_m))


def test_hits_tighten_the_calibration() -> None:
    before, afterwards, whitened = [], [], []
    for seed in range(3):
        truth, state, rng = calibrated(seed)
        before.append(aim_error_m(state.scanner, truth, targets_at(5.0)))
        state = after(state, truth, 80, rng)
        afterwards.append(aim_error_m(state.scanner, truth, targets_at(5.0)))
        there = point(truth, true_angles(state.scanner, targets_at(5.0)), targets_at(5.0))
        J = point(state.scanner, true_angles(state.scanner, targets_at(5.0)), targets_at(5.0))
        cov = J.by_scanner @ state.scanner.cov @ np.swapaxes(J.by_scanner, -1, -2)
        whitened.append((there.off * np.linalg.solve(cov, there.off[..., None])[..., 0]).sum(-1))
        assert state.refused <= 1
        assert warning(state, 7.0) is None
    assert np.mean(afterwards) < 0.6 * np.mean(before)
    assert 0.4 < np.mean(whitened) / 2.0 < 2.5


def test_hits_are_worth_as_much_as_samples() -> None:
    """One after the other, they leave about the covariance that all at once do."""
    truth, state, rng = calibrated(7)
    prior = np.linalg.inv(state.scanner.cov)
    hits = [hit_of(truth, *seen(rng), rng) for _ in range(40)]
    for hit in hits:
        state = absorb(state, hit)
        there = point(state.scanner, hit.theta, hit.p_cam)
        by_theta = hit.sigma_theta_rad * there.by_theta
        R = by_theta @ by_theta.T + (NOISE.point_m**2 + SIGMA_MIDDLE_M**2) * np.eye(2)
        prior = prior + there.by_scanner.T @ np.linalg.solve(R, there.by_scanner)
    J = point(
        state.scanner, true_angles(state.scanner, targets_at(5.0)), targets_at(5.0)
    ).by_scanner
    one_by_one, at_once = (
        np.einsum("nki,ij,nkj->n", J, cov, J).mean()
        for cov in (state.scanner.cov, np.linalg.inv(prior))
    )
    assert one_by_one == pytest.approx(at_once, rel=0.05)


@pytest.mark.parametrize("rate_rad", [2e-5, 1e-4])
@pytest.mark.parametrize("seed", range(3))
def test_a_drifting_mount_is_warned_of_before_a_beam_misses(seed: int, rate_rad: float) -> None:
    truth, state, rng = calibrated(seed)
    state = after(state, truth, 30, rng)
    for i in range(300):
        now = turned(truth, rate_rad * i * AXIS)
        p_cam, p_seen = seen(rng)
        assert not misses(state.scanner, now, targets_at(7.0)), f"missed at hit {i}"
        state = absorb(state, hit_of(now, p_cam, p_seen, rng))
        if said := warning(state, 7.0):
            break
    assert "the scanner's mount has turned by " in said
    assert " mm at 7.0 m: chi2 " in said
    assert state.drift is not None


def test_the_turn_is_estimated_and_reseating_aims_again() -> None:
    truth, state, rng = calibrated(3)
    state = after(state, truth, 30, rng)
    now = turned(truth, 2e-3 * AXIS)
    for _ in range(20):
        state = absorb(state, hit_of(now, *seen(rng), rng))
    assert state.drift is not None
    error = state.drift.turn - 2e-3 * AXIS
    assert error @ np.linalg.solve(state.drift.cov_turn, error) < 20.0
    off_m = aim_error_m(state.scanner, now, targets_at(5.0))
    seated = reseat(state)
    assert warning(seated, 5.0) is None
    assert aim_error_m(seated.scanner, now, targets_at(5.0)) < 0.4 * off_m


def test_a_single_wrong_hit_neither_teaches_nor_warns() -> None:
    truth, state, rng = calibrated(4)
    state = after(state, truth, 30, rng)
    good = hit_of(truth, *seen(rng), rng)
    wrong = Hit(good.theta + 0.1, good.p_cam, good.cov_cam, NOISE.theta_rad, SIGMA_MIDDLE_M)
    told = absorb(state, wrong)
    assert told.refused == state.refused + 1
    np.testing.assert_array_equal(told.scanner.T_cam_laser, state.scanner.T_cam_laser)
    assert warning(told, 7.0) is None


def test_the_drift_statistic_is_chi2_of_three_without_drift() -> None:
    """Of windows of 20 hits with fresh noise, about a reference drawn from its covariance."""
    _, state, rng = calibrated(5)
    known = state.scanner
    found = []
    for _ in range(40):
        truth = known.moved(rng.multivariate_normal(np.zeros(12), known.cov))
        fresh = begin(known)
        hits = tuple(hit_of(truth, *seen(rng), rng) for _ in range(20))
        drift = absorb(Online(fresh.scanner, fresh.reference, hits[:-1]), hits[-1]).drift
        assert drift is not None
        found.append(drift.chi2)
    assert np.mean(found) == pytest.approx(3.0, abs=1.0)
    assert max(found) < 20.0


def test_probing_finds_the_middle_of_what_is_lit() -> None:
    truth, state, rng = calibrated(6)
    spacing_m, errors = 0.004, []
    for _ in range(40):
        p_cam, p_seen = seen(rng)
        aimed = true_angles(state.scanner, p_seen)
        through = np.zeros(2)
        for axis in (0, 1):
            offsets_m = line(axis, through, spacing_m, 9)
            theta = beside(state.scanner, aimed, p_seen, offsets_m)
            lit = np.linalg.norm(point(truth, theta, p_cam).off, axis=-1) < TAG_RADIUS_M
            found = middle(offsets_m, lit)
            assert found is not None
            through = found
        theta = beside(state.scanner, aimed, p_seen, through)
        errors.append(point(truth, theta, p_cam).off)
    assert np.sqrt(np.mean(np.square(errors))) < 1.5 * sigma_middle_m(spacing_m)


def test_lines_that_are_not_bracketed_have_no_middle() -> None:
    offsets_m = line(1, np.array([0.001, 0.0]), 0.002, 2)
    np.testing.assert_allclose(offsets_m[:, 0], 0.001)
    for lit in ([0, 0, 0, 0, 0], [1, 1, 0, 0, 0], [0, 0, 0, 1, 1]):
        assert middle(offsets_m, np.array(lit, dtype=bool)) is None
    np.testing.assert_allclose(middle(offsets_m, np.array([0, 1, 1, 0, 0], bool)), [0.001, -0.001])
