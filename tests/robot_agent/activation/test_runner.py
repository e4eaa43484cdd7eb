"""The runner leaves no light behind, whatever the act or the devices do."""

import random

import pytest

from robot_agent.activation.commands import Aim, Allow, Answered, Ask, Denied, Light, Listen, Wait
from robot_agent.activation.runner import Devices, carry_out
from robot_agent.rfid.reader import Failure
from tests.robot_agent.laser.world import FaultyLaser, World, interlock_on


class Reader:
    error: type[BaseException] | None = None

    def inventory(self, _window_s):
        if self.error:
            raise self.error
        return Failure("nothing_heard", "nobody")


@pytest.fixture
def world():
    return World(random.Random(0))


@pytest.fixture
def laser(world):
    return FaultyLaser(world, faulty=False)


@pytest.fixture
def devices(world, laser):
    def wait_until(t_ns):
        world.t_ns = max(world.t_ns, t_ns)

    return Devices(interlock_on(world, laser), Reader(), world.clock, wait_until, lambda *_: None)


def lit():
    yield Allow(lambda *_: True)
    yield Aim((0, 0))
    yield Light(0.2)


def test_the_result_and_the_dark(devices, laser):
    def act():
        yield from lit()
        assert laser.is_on()
        return 5

    assert carry_out(act(), devices) == 5
    assert not laser.is_on()
    assert devices.interlock.light(0.1) is not None


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_act_that_breaks(devices, laser, error):
    def act():
        yield from lit()
        raise error

    with pytest.raises(error):
        carry_out(act(), devices)
    assert not laser.is_on()


def test_a_device_that_breaks(devices, laser):
    devices.reader.error = ZeroDivisionError
    ended = []

    def act():
        try:
            yield from lit()
            yield Listen(0.1)
        finally:
            ended.append(True)

    with pytest.raises(ZeroDivisionError):
        carry_out(act(), devices)
    assert not laser.is_on()
    assert ended


def test_what_each_command_comes_to(devices, world):
    def act():
        said = []
        for command in (
            Light(0.1),
            Aim((500, 0)),
            Listen(0.1),
            Ask(1.0, None, 0.1),
            Wait(world.t_ns + 5),
        ):
            reply = yield command
            said.append(type(reply.value))
        return said, reply.now_ns

    begin_ns = world.t_ns
    said, now_ns = carry_out(act(), devices)
    assert said == [Denied, Denied, Failure, Answered, type(None)]
    assert now_ns == begin_ns + 5
