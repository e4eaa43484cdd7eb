"""Which exposures become keyframes."""

import numpy as np
import pytest

from robot_agent.keyframes import Moment, Spacing, is_due
from robot_agent.odometry.odometry import OdomPose
from tagmap.geometry import se3

SPACING = Spacing()


def moment(t_s=0.0, x_m=0.0, yaw_rad=0.0, tags=(), still=False, epoch=0):
    T = se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, yaw_rad]))
    T[0, 3] = x_m
    odom = OdomPose(round(1e9 * t_s), T, epoch, x_m, yaw_rad)
    return Moment(round(1e9 * t_s), odom, frozenset(tags), still)


def test_the_first_one_is():
    assert is_due(SPACING, None, moment())


@pytest.mark.parametrize(
    ("now", "due"),
    [
        ({"t_s": 0.25}, False),
        ({"t_s": 0.25, "x_m": 0.21}, True),
        ({"t_s": 0.25, "x_m": -0.21}, True),
        ({"t_s": 0.25, "yaw_rad": 0.11}, True),
        ({"t_s": 0.6}, True),
        ({"t_s": 0.6, "still": True}, False),
        ({"t_s": 2.1, "still": True}, True),
        ({"t_s": 0.25, "tags": ("new",), "still": True}, True),
    ],
)
def test_after_way_turn_time_or_a_new_name(now, due):
    assert is_due(SPACING, moment(), moment(**now)) is due


def test_names_that_went_are_no_reason():
    assert not is_due(SPACING, moment(tags=("a", "b")), moment(0.2, tags=("a",)))


def test_odometry_that_began_anew_tells_no_way():
    assert not is_due(SPACING, moment(), moment(0.2, x_m=5.0, epoch=1))


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), 1e9])
def test_a_spacing_that_cannot_be_is_refused(value):
    with pytest.raises(ValueError, match="way_m is"):
        Spacing(way_m=value)


def test_a_clock_that_was_set_back_does_not_stop_them():
    last = moment(3600.0)
    assert is_due(SPACING, last, moment(0.0, still=True))
    assert not is_due(SPACING, moment(0.0), moment(0.1, still=True))
