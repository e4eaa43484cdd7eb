"""The axis moves as its manual says: speed, acceleration, changes on the fly."""

import numpy as np
import pytest

from fleet.emulation.pan_tilt.axis import Axis

MS = 1_000_000


def course(axis: Axis, duration_ms: int) -> np.ndarray:
    """Position each ms."""
    positions = []
    for _ in range(duration_ms):
        axis.turn(MS)
        positions.append(axis.position)
    return np.array(positions)


def test_below_base_speed_it_moves_at_once_and_evenly():
    axis = Axis(185.1428, -3090, 3090, speed=500, target=250)
    np.testing.assert_allclose(course(axis, 500), 0.5 * np.arange(1, 501))
    assert axis.at_rest
    assert axis.position == 250


def test_above_base_speed_the_profile_is_a_trapezoid():
    axis = Axis(185.1428, -3090, 3090, speed=2000, acceleration=2000, base=1000, target=3000)
    speed = np.diff(course(axis, 3000), prepend=0.0) * 1000.0
    assert speed.max() == pytest.approx(2000.0)
    assert np.abs(np.diff(speed[speed > 1001.0])).max() <= 2.1
    # Half a second up, half a second down over 1500 positions, 0.75 s for the other 1500.
    assert np.count_nonzero(speed) == pytest.approx(1750, abs=10)
    assert axis.position == 3000


def test_a_target_behind_is_reached_after_slowing_down():
    axis = Axis(185.1428, -3090, 3090, speed=2000, acceleration=2000, base=500, target=2000)
    course(axis, 800)
    axis.target = -100
    positions = course(axis, 4000)
    assert positions.max() > positions[0]
    assert axis.position == -100
    assert np.abs(np.diff(positions)).max() <= 2.01


def test_halting():
    axis = Axis(185.1428, -3090, 3090, target=2000)
    course(axis, 100)
    axis.halt()
    assert axis.at_rest
    assert 0 < axis.position < 2000
