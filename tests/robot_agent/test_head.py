"""Where the head was sent, and whether it has come to rest there."""

import pytest

from robot_agent.head import PATIENCE_NS, UNKNOWN, Head
from robot_agent.pan_tilt.unit import Angles, Failure
from tests.robot_agent.devices_in_hand import AHEAD, Unit

ASIDE = Angles(0.4, 0.5)
REFUSED = Failure("refused", "the unit will not")


def new():
    unit = Unit()
    return unit, Head(unit, unit)


def test_it_stands_at_two_exposures_in_a_row():
    _, head = new()
    assert [head.is_still(a, 0) for a in (AHEAD, AHEAD, ASIDE, ASIDE)] == [False, True] * 2


def test_not_where_its_angles_are_not_known():
    _, head = new()
    head.is_still(AHEAD, 0)
    assert not head.is_still(None, 1)
    assert not head.is_still(AHEAD, 2)
    assert head.is_still(AHEAD, 3)


@pytest.mark.parametrize(("off_rad", "still"), [(1e-3, True), (5e-3, False)])
def test_steps_of_the_encoder_are_no_motion(off_rad, still):
    _, head = new()
    head.is_still(AHEAD, 0)
    assert head.is_still(Angles(AHEAD.pan_rad + off_rad, AHEAD.tilt_rad), 1) is still


def test_a_head_that_is_stuck_is_looked_at_where_it_is_after_a_while():
    _, head = new()
    head.is_still(AHEAD, 0)
    head.turn(ASIDE, 0)
    assert not head.is_still(AHEAD, PATIENCE_NS)
    assert head.is_still(AHEAD, PATIENCE_NS + 1)


def test_a_move_that_is_refused_is_told_and_not_waited_for():
    unit, head = new()
    unit.refuses = REFUSED
    head.is_still(AHEAD, 0)
    head.turn(ASIDE, 0)
    assert head.is_still(AHEAD, 1)
    assert head.trouble(unit.at(0)) == "the unit will not"
    unit.refuses = None
    head.turn(ASIDE, 2)
    assert head.trouble(unit.at(0)) is None


def test_why_it_is_not_known_where_it_looks():
    unit, head = new()
    assert [head.trouble(None) for _ in range(UNKNOWN)][:-1] == [None] * (UNKNOWN - 1)
    assert head.trouble(None) == "no angles around the times of exposures"
    unit.failure = Failure("unit_gone", "no port")
    assert head.trouble(None) == "no port"
    unit.failure = None
    assert head.trouble(unit.at(0)) is None
