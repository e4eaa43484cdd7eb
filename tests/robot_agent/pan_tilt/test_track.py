"""Angles at exposure: exact where they can be, never beyond the readings, honest about the rest."""

import numpy as np
import pytest

from fleet.emulation.pan_tilt.axis import Axis
from robot_agent.pan_tilt.track import PointingTrack, interpolate
from robot_agent.pan_tilt.unit import Angles, AxisSample, Reading

STEP = 0.0009
MS = 1_000_000


def sample(t_ms: float, angle_rad: float, within_ms: float = 0.0, step: float = 0.0) -> AxisSample:
    return AxisSample(round(t_ms * MS), round(within_ms * MS), angle_rad, step)


def test_even_motion_is_interpolated_without_error():
    samples = [sample(30 * k, 0.02 * k) for k in range(5)]
    assert interpolate(samples, 75 * MS) == pytest.approx((0.05, 0.0), abs=1e-12)


def test_each_source_of_error_counts():
    standing = [sample(30 * k, 0.5, within_ms=7.0, step=STEP) for k in range(4)]
    assert interpolate(standing, 50 * MS) == pytest.approx((0.5, STEP / 12**0.5))
    turning = [sample(30 * k, 0.03 * k, within_ms=7.0) for k in range(4)]
    assert interpolate(turning, 50 * MS) == pytest.approx((0.05, 0.007 / 3**0.5))
    # At 0, then from the middle of the second gap on at 1 rad/s: 7.5 mrad off at worst.
    starting = [sample(30 * k, angle) for k, angle in enumerate((0.0, 0.0, 0.015, 0.045))]
    angle, sigma = interpolate(starting, 45 * MS) or (0.0, 0.0)
    assert (angle, sigma) == pytest.approx((0.0075, 0.0075 / 3**0.5))


@pytest.mark.parametrize("t_ms", [-1, 90, 1000])
def test_nothing_is_extrapolated(t_ms: int):
    samples = [sample(30 * k, 0.5) for k in range(4)]
    assert interpolate(samples, t_ms * MS) is None


def test_a_long_gap_is_no_answer():
    assert interpolate([sample(0, 0.0), sample(600, 0.0)], 300 * MS) is None


def test_both_axes_are_needed_and_a_clock_set_back_begins_anew():
    track = PointingTrack()
    for k in range(3):
        track.add(Reading(sample(30 * k, 0.1 * k), sample(30 * k + 15, 0.2)))
    assert track.at(10 * MS) is None
    found = track.at(20 * MS)
    assert found is not None
    assert found.angles == Angles(pytest.approx(0.2 / 3), 0.2)
    track.add(Reading(sample(5, 1.0), sample(20, 1.0)))
    assert track.at(20 * MS) is None


def test_it_rests_where_the_readings_around_are_alike():
    track = PointingTrack()
    for k, tilt in enumerate((0.0, 0.1, 0.2, 0.2, 0.2, 0.2, 0.2)):
        track.add(Reading(sample(30 * k, 0.5), sample(30 * k, tilt)))
    rests = [found.rests for k in range(6) if (found := track.at((30 * k + 15) * MS)) is not None]
    assert rests == [False, False, False, True, True, True]


def test_errors_are_as_large_as_stated_on_a_real_course():
    """Axis moves to and fro, polled unevenly and with unknown delay, asked at random times."""
    rng = np.random.default_rng(0)
    axis = Axis(185.1428, -3090, 3090, speed=1500)
    step_rad = np.radians(axis.arcsec / 3600)
    course = np.zeros(8000)
    for t in range(len(course)):
        if t % 700 == 0:
            axis.target = int(rng.integers(-1500, 1500))
        axis.turn(MS)
        course[t] = round(axis.position) * step_rad
    samples, t = [], 10
    while t < len(course) - 20:
        truly = t + int(rng.integers(-7, 8))
        samples.append(AxisSample(t * MS, 7 * MS, float(course[truly]), step_rad))
        t += int(rng.integers(25, 40))
    asked = rng.integers(100, len(course) - 100, 4000)
    found = [interpolate(samples, int(t) * MS) for t in asked]
    errors = np.array([f[0] - course[t] for f, t in zip(found, asked, strict=True) if f])
    sigmas = np.array([f[1] for f in found if f])
    assert len(errors) == len(asked)
    normalised = errors / sigmas
    assert np.mean(np.abs(normalised) < 3.0) > 0.995
    assert 0.3 < np.sqrt(np.mean(normalised**2)) < 1.1
