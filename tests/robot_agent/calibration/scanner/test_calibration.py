"""Scanners are found again, as well as can be; bad samples are named; too few are refused."""

import numpy as np
import pytest

from fleet.evaluation.aim import aim_bound_m, aim_error_m
from fleet.simulation import scanning
from fleet.simulation.scanning import NOISE
from robot_agent.calibration.scanner.calibration import FEWEST, calibrate
from robot_agent.calibration.scanner.fit import Noise, fit
from robot_agent.calibration.scanner.samples import Samples
from robot_agent.calibration.scanner.start import place
from tagmap.errors import DataError, DegenerateError
from tagmap.geometry import se3
from tagmap.geometry.scanner.mirrors import Mirrors
from tagmap.geometry.scanner.scanner import MODELS, Scanner
from tagmap.records.scanner import UNKNOWNS

TINY = Noise(1e-7, 1e-6)
RANGES_M = (3.0, 7.0)


def targets_at(seed: int, depth_m: float) -> np.ndarray:
    return scanning.anywhere(np.random.default_rng(seed), 200, (depth_m, depth_m))


def test_unknowns_of_the_record_are_those_of_the_models() -> None:
    assert {name: 6 + len(MODELS[name]) for name in UNKNOWNS} == UNKNOWNS


def test_with_hardly_any_noise_the_truth_is_found() -> None:
    rng = np.random.default_rng(1)
    truth = scanning.built(rng)
    samples = scanning.sampled(truth, scanning.field_grid(), rng, TINY)
    found = calibrate("full", samples, TINY)
    for depth_m in RANGES_M:
        assert aim_error_m(found.scanner, truth, targets_at(2, depth_m)) < 3e-6
    assert not found.bad
    assert found.near.off_m < 1e-5


def test_the_neutral_angles_are_fixed_and_may_be_anything() -> None:
    """Pure gauge: a scanner built with other neutral angles is aimed as well."""
    rng = np.random.default_rng(2)
    built = scanning.built(rng)
    values = built.mirrors.values
    values[2:4] += [0.08, -0.06]
    truth = Scanner(Mirrors(*values), built.T_cam_laser, built.free, built.cov)
    samples = scanning.sampled(truth, scanning.field_grid(), rng, TINY)
    found = calibrate("full", samples, TINY).scanner
    assert (found.mirrors.neutral_1_rad, found.mirrors.neutral_2_rad) == (np.pi / 4, np.pi / 4)
    for depth_m in RANGES_M:
        assert aim_error_m(found, truth, targets_at(3, depth_m)) < 3e-6


def test_the_covariance_is_that_of_the_aim() -> None:
    """Mean squared error of whitened aims over calibrations is what the covariance says."""
    squares = []
    for seed in range(12):
        rng = np.random.default_rng(100 + seed)
        truth = scanning.built(rng)
        samples = scanning.sampled(truth, scanning.field_grid(), rng)
        start = Scanner(Mirrors(0.02), place(samples), MODELS["full"], np.eye(12))
        found = fit(start, samples, NOISE)
        assert found.converged
        p_cam = targets_at(seed, 5.0)
        error_m = aim_error_m(found.scanner, truth, p_cam)
        squares.append((error_m / aim_bound_m(truth, scanning.field_grid(), NOISE, p_cam)) ** 2)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.4)


@pytest.mark.parametrize("seed", range(4))
def test_bad_samples_are_found_and_named_and_no_others(seed: int, grid_of) -> None:
    truth, samples = grid_of(seed)
    rng = np.random.default_rng(seed)
    bad = np.sort(rng.choice(30, 8, replace=False))
    samples.p_cam[bad[:4]] = scanning.anywhere(rng, 4)
    samples.p_cam[bad[4:], 0] += [0.05, -0.1, 0.3, 0.08]
    found = calibrate("full", samples, NOISE)
    assert [line for line, _ in found.bad] == (bad + 2).tolist()
    for _, reason in found.bad:
        assert reason.startswith("is ")
        assert " mm off, expected at most " in reason
    assert aim_error_m(found.scanner, truth, targets_at(1, 3.0)) < 0.005


def null_vector_start(samples: Samples) -> np.ndarray:
    """T_cam_laser by the thesis, 3.5-3.8, with d unknown too: the null vector of [U, -D / d]."""
    (x, y), P = 2.0 * samples.theta.T, np.insert(samples.p_cam, 3, 1.0, axis=1)
    tan, cos, sin = np.tan(x)[:, None], np.cos(y)[:, None], np.sin(y)[:, None]
    none = np.zeros_like(P)
    rows = np.concatenate(
        [
            np.hstack([cos * P, tan * P, none, tan * cos]),
            np.hstack([sin * P, none, tan * P, tan * sin]),
        ]
    )
    M = np.linalg.svd(rows)[2][-1][:12].reshape(3, 4)
    U, S, Vt = np.linalg.svd(M[:, :3])
    sign = np.linalg.det(U @ Vt)
    return se3.inverse(se3.from_p_R(M[:, 3] / (sign * S.mean()), sign * U @ Vt))


def turned_rad(T: np.ndarray, truth: Scanner) -> float:
    return float(np.linalg.norm(se3.log(se3.inverse(truth.T_cam_laser) @ T)[3:]))


def test_the_start_survives_what_the_linear_one_does_not(grid_of) -> None:
    truth, samples = grid_of(5)
    assert turned_rad(null_vector_start(samples), truth) < 0.1
    assert turned_rad(place(samples), truth) < 0.1
    samples.p_cam[7] += [1.0, 0.5, 0.0]
    assert turned_rad(null_vector_start(samples), truth) > 0.3
    assert turned_rad(place(samples), truth) < 0.1


def test_one_wall_leaves_other_ranges_open_and_says_so() -> None:
    rng = np.random.default_rng(6)
    truth = scanning.built(rng)
    wall = scanning.anywhere(rng, 30, (4.0, 4.0))
    found = calibrate("full", scanning.sampled(truth, wall, rng), NOISE)
    assert aim_error_m(found.scanner, truth, targets_at(4, 4.0)) < 0.004
    assert any("the aim at other ranges is open" in note for note in found.notes)


def test_the_wrong_model_is_noticed(grid_of) -> None:
    _, samples = grid_of(7)
    found = calibrate("simplified", samples, NOISE)
    assert found.far.off_m > 0.01
    assert any("times the stated noise: try --model full" in note for note in found.notes)


def test_held_out_samples_are_off_as_expected(grid_of) -> None:
    found = [calibrate("full", grid_of(seed)[1], NOISE) for seed in range(20, 26)]
    for half in ("near", "far"):
        halves = [getattr(one, half) for one in found]
        off, expected = (
            np.mean([getattr(h, k) ** 2 for h in halves]) for k in ("off_m", "expected_m")
        )
        assert off == pytest.approx(expected, rel=0.35)
    assert found[0].near.range_m < found[0].far.range_m
    assert found[0].near.n + found[0].far.n == 30


@pytest.mark.parametrize("model", ["simplified", "full"])
def test_too_few_samples_say_how_many_are_needed(model: str, grid_of) -> None:
    _, samples = grid_of(8)
    few = samples.only(np.arange(0, 30, 3))
    few = few.only(np.arange(FEWEST[model] - 1))
    message = (
        f"{len(few)} good samples, expected at least {FEWEST[model]} for the {UNKNOWNS[model]} un"
    )
    with pytest.raises(DataError, match=message):
        calibrate(model, few, NOISE)


def test_the_fewest_samples_do() -> None:
    rng = np.random.default_rng(9)
    truth = scanning.built(rng)
    samples = scanning.sampled(truth, scanning.anywhere(rng, FEWEST["full"]), rng)
    found = calibrate("full", samples, NOISE)
    assert any("10 good samples, 30 on a grid" in note for note in found.notes)


NO_SCANNER = {
    "angles of the beam": lambda theta: 2.0 * theta,
    "mirrors exchanged": lambda theta: theta[:, ::-1],
    "one mirror counts the other way": lambda theta: theta * [1.0, -1.0],
}


@pytest.mark.parametrize("what", NO_SCANNER)
def test_samples_that_fit_no_scanner_are_refused(what: str, grid_of) -> None:
    _, samples = grid_of(10)
    wrong = Samples(NO_SCANNER[what](samples.theta), samples.p_cam, samples.lines)
    message = r"\d+ of 30 samples agree on a scanner, expected at least two thirds; are theta1_rad"
    with pytest.raises(DataError, match=message):
        calibrate("full", wrong, NOISE)


def test_targets_in_one_line_are_refused() -> None:
    line = np.linspace([0.0, 0.0, 2.0], [1.0, 0.0, 6.0], 15)
    truth = scanning.built(np.random.default_rng(11))
    theta = scanning.true_angles(truth, line)
    with pytest.raises(DegenerateError, match="in one line or place: spread them over the view"):
        calibrate("full", Samples(theta, line, np.arange(15)), NOISE)
