"""Targets to steps of the converter: limits are kept, and a refusal says why."""

import re

import numpy as np
import pytest

from tagmap.geometry import se3
from tagmap.geometry.scanner.aiming import Refused, aim, why_not
from tagmap.geometry.scanner.drive import angles_of, nearest_steps, volts
from tagmap.geometry.scanner.mirrors import beam
from tagmap.geometry.scanner.scanner import point
from tests.geometry.scanners import DRIVE, SCANNER, targets


def shone_at(theta: list[float], range_m: float = 4.0) -> np.ndarray:
    """The point (3,) in cam that these mirror angles light at that range."""
    ray = beam(SCANNER.mirrors, np.array(theta))
    return se3.act(SCANNER.T_cam_laser, ray.start + range_m * ray.direction)


def test_steps_and_angles_agree_to_half_a_step() -> None:
    theta = np.random.default_rng(1).uniform(-0.2, 0.2, (5, 7, 2))
    steps = nearest_steps(DRIVE, theta)
    assert DRIVE.v_per_step == 20.0 / 65536
    error_v = volts(DRIVE, angles_of(DRIVE, steps)) - volts(DRIVE, theta)
    assert np.abs(error_v).max() <= 0.5 * DRIVE.v_per_step * (1.0 + 1e-9)
    np.testing.assert_array_equal(nearest_steps(DRIVE, angles_of(DRIVE, steps)), steps)
    ends = angles_of(DRIVE, np.array([[0, 0], [65535, 65535]]))
    np.testing.assert_allclose(volts(DRIVE, ends)[:, 0], [-10.0, 10.0 - 20.0 / 65536])


@pytest.mark.parametrize("shape", [(), (0,), (60,), (2, 3)])
def test_what_is_within_reach_is_aimed_at_to_a_step(shape: tuple[int, ...]) -> None:
    p_cam = targets(np.random.default_rng(2), shape)
    aims = aim(SCANNER, DRIVE, p_cam)
    assert aims.refused.shape == shape
    assert not aims.refused.any()
    np.testing.assert_allclose(point(SCANNER, aims.theta, p_cam).off, 0.0, atol=1e-11)
    np.testing.assert_allclose(angles_of(DRIVE, aims.steps), aims.theta_set)
    off_m = np.linalg.norm(point(SCANNER, aims.theta_set, p_cam).off, axis=-1)
    np.testing.assert_allclose(aims.off_m, off_m, atol=1e-15)
    # A step of 305 uV is 15 urad, its half doubled by the mirror 15 urad: 0.1 mm at 8 m.
    assert (aims.off_m < 2e-4).all()


def test_the_uncertainty_of_aiming_is_that_of_scanner_and_target() -> None:
    rng = np.random.default_rng(3)
    p_cam, cov_cam = np.array([0.5, -0.3, 4.0]), np.diag([1e-6, 4e-6, 1e-4])
    aims = aim(SCANNER, DRIVE, p_cam, cov_cam)
    tried = [
        aim(SCANNER.moved(delta), DRIVE, p_cam + error).theta
        for delta, error in zip(
            rng.multivariate_normal(np.zeros(12), SCANNER.cov, 1000),
            rng.multivariate_normal(np.zeros(3), cov_cam, 1000),
            strict=True,
        )
    ]
    np.testing.assert_allclose(aims.cov_theta, np.cov(np.transpose(tried)), rtol=0.15, atol=2e-8)


REFUSALS = {
    "mirror X": ([0.31, 0.0], Refused.ANGLE_X | Refused.VOLTS_X,
                 r"mirror X at 0\.3100 rad, expected -0\.3000 to 0\.3000 rad"),
    "mirror Y": ([0.0, 0.26], Refused.ANGLE_Y, r"mirror Y at 0\.2600 rad, expected -0\.2500 to"),
    "volts of X": ([0.27, 0.0], Refused.VOLTS_X, r"mirror X at 5\.500 V, expected -8\.000 to 5"),
    "volts of Y": ([0.0, -0.22], Refused.VOLTS_Y, r"mirror Y at 5\.300 V, expected -8\.000 to 5"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSALS)
def test_what_is_out_of_reach_is_refused_with_the_reason(what: str) -> None:
    theta, refused, reason = REFUSALS[what]
    p_cam = shone_at(theta)
    aims = aim(SCANNER, DRIVE, p_cam)
    assert Refused(int(aims.refused)) == refused
    np.testing.assert_allclose(aims.theta, theta, atol=1e-11)
    assert aims.steps.tolist() == [-1, -1]
    assert np.isnan(aims.off_m)
    assert np.isnan(aims.theta_set).all()
    assert np.isnan(aims.cov_theta).all()
    said = why_not(DRIVE, aims, p_cam)
    assert said is not None
    assert said.startswith(f"target ({p_cam[0]:.3f}, ")
    assert " m in cam: " in said
    assert re.search(reason, said), said


def test_a_target_without_beam_is_refused() -> None:
    p_cam = np.array([50.0, 0.0, 1.0])
    aims = aim(SCANNER, DRIVE, p_cam)
    assert aims.refused == Refused.NO_BEAM
    assert "no mirror angles send the beam there" in (why_not(DRIVE, aims, p_cam) or "")


def test_what_is_reached_has_no_reason_and_a_batch_may_mix() -> None:
    p_cam = np.stack([shone_at([0.1, 0.1]), shone_at([0.31, 0.0])])
    aims = aim(SCANNER, DRIVE, p_cam)
    assert (aims.refused != 0).tolist() == [False, True]
    assert why_not(DRIVE, aim(SCANNER, DRIVE, p_cam[0]), p_cam[0]) is None
