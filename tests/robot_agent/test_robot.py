"""The cycle with devices that fail and come back: each is told once, and what is left goes on."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from robot_agent.activation.verdict import Outcome, Verdict
from robot_agent.cameras.camera import Failure as CameraFailure
from robot_agent.laser.interlock import DeviceFailed
from robot_agent.odometry.odometry import Failure as OdometryFailure
from robot_agent.pan_tilt.unit import Angles
from robot_agent.pan_tilt.unit import Failure as UnitFailure
from robot_agent.robot import UNKNOWN, Pointing
from tagmap import logs
from tests.robot_agent.devices_in_hand import robot

GONE = CameraFailure("camera_gone", "camera 0 was unplugged")
SILENT = OdometryFailure("silent", "no reading for 1.0 s")
LOST = UnitFailure("unit_gone", "no port")


@pytest.fixture
def told(capsys):
    logs.configure()
    return lambda: [json.loads(line)["event"] for line in capsys.readouterr().err.splitlines()]


def cycles(one, n):
    return [one.cycle() for _ in range(n)]


def frame(one):
    return one.agent.frames[-1]


def test_all_is_well(told):
    one = robot(unit=True)
    reports = cycles(one, 3)
    assert all(reports)
    assert frame(one).is_still
    assert frame(one).odom is not None
    assert told() == []


def test_cameras_that_fail_and_come_back(told):
    one = robot()
    one.cycle()
    one.cameras.failure = GONE
    assert cycles(one, 5) == [None] * 5
    assert one.failure is GONE
    one.cameras.failure = CameraFailure("stalled", "another reason now")
    one.cycle()
    one.cameras.failure = None
    assert all(cycles(one, 3))
    assert one.failure is None
    assert told() == ["cameras: failed, going on without", "cameras: works again"]


def test_a_recording_that_is_over_is_no_failure(told):
    one = robot()
    one.cameras.failure = CameraFailure("ended", "no more pairs")
    assert one.cycle() is None
    assert one.failure.reason == "ended"
    assert told() == []


def test_odometry_that_is_lost_and_comes_back(told):
    """The robot sees on, and does not take itself for standing."""
    one = robot()
    one.odometer.failure = SILENT
    assert all(cycles(one, 4))
    assert frame(one).odom is None
    assert not frame(one).is_still
    one.odometer.failure = None
    cycles(one, 2)
    assert frame(one).is_still
    assert told() == ["odometry: failed, going on without", "odometry: works again"]


def test_one_reading_that_is_late_costs_one_exposure_and_nothing_else(told):
    one = robot()
    one.cycle()
    one.odometer.late = UNKNOWN - 1
    assert cycles(one, UNKNOWN - 1) == [None] * (UNKNOWN - 1)
    assert one.cycle() is not None
    assert len(one.agent.frames) == 2
    assert all(seen.odom is not None for seen in one.agent.frames)
    assert told() == []


def test_exposures_of_another_time_are_told_and_not_taken_for_still(told):
    """As of a camera whose clock is off: there are readings, but none for them."""
    one = robot()
    one.odometer.late = 10**6
    reports = cycles(one, UNKNOWN + 3)
    assert reports[: UNKNOWN - 1] == [None] * (UNKNOWN - 1)
    assert all(reports[UNKNOWN - 1 :])
    assert not any(seen.is_still for seen in one.agent.frames)
    one.odometer.late = 0
    cycles(one, 2)
    assert frame(one).is_still
    assert told() == ["odometry: failed, going on without", "odometry: works again"]


def test_it_stands_when_it_has_stood_since_before_the_exposure():
    one = robot()
    one.odometer.since_ns = one.utc_ns() + 100_000_001
    one.cycle()
    assert not frame(one).is_still
    one.cycle()
    assert frame(one).is_still
    one.odometer.since_ns = None
    one.cycle()
    assert not frame(one).is_still


@pytest.mark.parametrize("stationary", [False, True])
def test_without_an_odometer_only_the_settings_know(stationary):
    one = robot(wheels=False, stationary=stationary)
    one.cycle()
    assert frame(one).is_still is stationary


def test_a_pan_tilt_unit_that_is_lost_and_comes_back(told):
    one = robot(unit=True)
    cycles(one, 2)
    one.mounting.failure = LOST
    assert cycles(one, 3) == [None] * 3, "it is not known where the camera looks"
    one.mounting.failure = None
    assert all(cycles(one, 2))
    assert told() == ["pan-tilt: failed, going on without", "pan-tilt: works again"]


def test_a_head_is_sent_and_waited_for():
    one = robot(unit=True)
    cycles(one, 2)
    there = Angles(0.3, 0.5)
    one.agent.look = there
    one.cycle()
    one.agent.look = None
    assert one.mounting.sent == [there]
    one.mounting.angles = Angles(0.1, 0.5)
    cycles(one, 3)
    assert not frame(one).is_still, "it stands, but not where it was sent"
    one.mounting.angles = there
    one.cycle()
    assert not frame(one).is_still
    one.cycle()
    assert frame(one).is_still


def test_the_laser_is_dark_before_the_head_is_sent():
    log = []
    one = robot(unit=True, devices=interlocked(log))
    cycles(one, 2)
    one.agent.look = Angles(0.3, 0.5)
    move = one.head.unit.move
    one.head.unit.move = lambda angles: log.append("turns") or move(angles)
    log.clear()
    one.cycle()
    assert [what for what in log if what in ("moved", "turns")] == ["moved", "turns"]


def interlocked(log):
    """Devices of which only the interlock is asked."""

    def note(name):
        return lambda *_: log.append(name)

    names = ("allow", "mark", "beat", "moved", "dark")
    interlock = SimpleNamespace(**{name: note(name) for name in names})
    return SimpleNamespace(interlock=interlock, now_ns=lambda: 0)


def outcome(kind, reason="because"):
    return Outcome(None, Verdict(kind, reason), None, 0, 1)


def test_a_laser_that_fails_and_comes_back(told):
    one = robot()
    broken = outcome("timeout", DeviceFailed("laser did not answer"))
    for outcomes in ((broken,), (broken, broken), (), (outcome("ambiguous"),), ()):
        one.agent.outcomes = outcomes
        one.cycle()
    assert told() == ["laser and reader: failed, going on without", "laser and reader: works again"]


def test_a_permit_that_ends_early_is_no_failure(told):
    one = robot()
    one.agent.outcomes = (outcome("timeout", "the permit is over, or too short"),)
    cycles(one, 2)
    assert told() == []


def test_where_the_beam_goes_is_not_known_before_an_exposure_was():
    assert np.isnan(Pointing()()).all()
    one = robot(unit=True)
    assert np.isnan(one.pointing()).all()
    one.cycle()
    assert np.isfinite(one.pointing()).all()


def test_an_exception_leaves_the_laser_to_nobody():
    log = []
    one = robot(devices=interlocked(log))
    one.agent = replace(one.agent)

    def step(*_):
        raise ZeroDivisionError
        yield

    one.agent.step = step
    with pytest.raises(ZeroDivisionError):
        one.cycle()
    assert log[-2:] == ["mark", "allow"]
