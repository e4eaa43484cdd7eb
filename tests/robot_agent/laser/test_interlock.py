"""Each reason for which the laser is dark, one at a time."""

import random

import pytest

from robot_agent.laser.interlock import SECOND_NS
from tests.robot_agent.laser.world import FaultyLaser, World, interlock_on


class Bench:
    def __init__(self):
        self.world = World(random.Random(0))
        self.device = FaultyLaser(self.world, faulty=False)
        self.interlock = interlock_on(self.world, self.device)

    def ready(self, for_s=10.0):
        ends_ns = self.world.clock() + round(for_s * SECOND_NS)
        self.world.permit_ends_ns = ends_ns
        permit = lambda now_ns, s: now_ns + round(s * SECOND_NS) <= ends_ns  # noqa: E731
        self.interlock.allow(permit, self.interlock.mark())
        self.interlock.beat()
        assert self.interlock.steer((0, 0)) is None
        return self

    def lit(self):
        assert self.ready().interlock.light(0.1) is None
        assert self.device.is_on()
        return self

    def passes(self, s):
        self.world.passes(s)


@pytest.fixture
def bench():
    return Bench()


def test_a_window_is_as_long_as_asked(bench):
    bench.lit().passes(0.099)
    assert bench.interlock.check() is None
    assert bench.interlock.is_lit()
    assert bench.device.is_on()
    bench.passes(0.002)
    assert not bench.device.is_on()
    assert bench.interlock.check() == "the window is over"


def test_nobody_allowed_it(bench):
    bench.interlock.steer((0, 0))
    assert bench.interlock.light(0.1) == "nobody allowed it"


def test_a_permit_must_outlast_the_window(bench):
    assert "too short" in bench.ready(for_s=0.05).interlock.light(0.1)


def test_a_permit_that_ends_ends_the_light(bench):
    bench.lit().interlock.allow(None, bench.interlock.mark())
    assert not bench.device.is_on()


def test_another_permit_needs_another_aim(bench):
    bench.ready().interlock.allow(lambda *_: True, bench.interlock.mark())
    assert bench.interlock.light(0.1) == "the mirrors were not steered"


def test_no_heartbeat(bench):
    bench.ready().passes(0.45)
    assert "no heartbeat" in bench.interlock.light(0.1)


@pytest.mark.parametrize("steps", [(60, 0), (-60, 0), (0, 70), (0, -30)])
def test_outside_the_sector(bench, steps):
    assert "allowed are" in bench.lit().interlock.steer(steps)
    assert not bench.device.is_on()
    assert bench.interlock.light(0.1) == "the mirrors were not steered"


def test_a_direction_that_nobody_knows_is_outside(bench):
    bench.lit().interlock._direction = lambda _: (float("nan"), 0.0)
    assert "nan rad" in bench.interlock.steer((0, 0))


def test_light_at_a_stretch(bench):
    bench.lit().passes(0.1)
    assert bench.interlock.light(0.1) is None
    bench.passes(0.1)
    assert "at a stretch" in bench.interlock.light(0.2)
    bench.passes(0.3)
    bench.interlock.beat()
    assert bench.interlock.light(0.1) is None


def test_light_that_would_not_last_is_known_before(bench):
    assert bench.interlock.tired(0.25) is None
    bench.lit().passes(0.1)
    assert bench.interlock.tired(0.1) is None
    assert "so soon" in bench.interlock.tired(0.25)
    assert "so soon" in bench.interlock.tired(100.0)
    bench.interlock.dark()
    bench.passes(0.3)
    assert bench.interlock.tired(100.0) is None


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("by_s", [-100.0, -0.01, 0.01, 100.0])
def test_a_clock_jumps(bench, which, by_s):
    bench.lit().world.jumped[which] += round(by_s * SECOND_NS)
    assert "a clock jumped" in bench.interlock.check()
    assert not bench.device.is_on()
    bench.interlock.beat()
    assert bench.interlock.light(0.1) is not None


def test_the_mount_moves(bench):
    bench.lit().interlock.moved()
    assert not bench.device.is_on()
    assert bench.interlock.light(0.1) == "the mirrors were not steered"


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_an_exception_while_lighting(bench, error):
    light = bench.ready().device.light

    def broken(until_ns):
        light(until_ns)
        raise error

    bench.device.light = broken
    with pytest.raises(error):
        bench.interlock.light(0.1)
    assert not bench.device.is_on()


def test_stopped_while_lighting(bench):
    """As a signal does that comes between the decision and the device."""
    light = bench.ready().device.light

    def interrupted(until_ns):
        bench.interlock.stop("signal 15")
        light(until_ns)

    bench.device.light = interrupted
    assert bench.interlock.light(0.1) == "signal 15"
    assert not bench.device.is_on()


def test_an_exception_anywhere_else(bench):
    with pytest.raises(ValueError, match="elsewhere"), bench.lit().interlock:
        raise ValueError("elsewhere")
    assert not bench.device.is_on()
    bench.interlock.allow(lambda *_: True, bench.interlock.mark())
    assert bench.interlock.steer((0, 0)) == "closed"
    assert bench.interlock.light(0.1) == "closed"


def test_a_device_that_does_not_confirm_the_dark_is_not_steered(bench):
    dark = bench.lit().device.dark
    bench.device.dark = lambda: (_ for _ in ()).throw(ZeroDivisionError)
    assert "did not confirm" in bench.interlock.steer((1, 1))
    assert bench.device.steps == (0, 0)
    bench.device.dark = dark
    assert bench.interlock.steer((1, 1)) is None


def test_light_that_nobody_could_end_counts(bench):
    dark = bench.lit().device.dark
    bench.device.dark = lambda: (_ for _ in ()).throw(ZeroDivisionError)
    bench.interlock.dark()
    bench.passes(0.1)
    bench.device.dark = dark
    bench.interlock.steer((0, 0))
    assert "at a stretch" in bench.interlock.light(0.25)
