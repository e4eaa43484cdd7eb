"""Who reads the angles of a unit also sees that it turns, whoever made it."""

import threading

from robot_agent.pan_tilt.poller import Poller
from robot_agent.pan_tilt.unit import AxisSample, Failure, Reading

GONE = Failure("unit_gone", "no port")


def reading(t_ns, pan_rad, tilt_rad=0.2):
    axes = (AxisSample(t_ns, 1000, angle, 1e-4) for angle in (pan_rad, tilt_rad))
    return Reading(*axes)


class Unit:
    """Hands out these readings, then the last one for ever; `over` once that has begun."""

    def __init__(self, *readings):
        self.readings, self.over = list(readings), threading.Event()

    def read(self):
        if len(self.readings) > 1:
            return self.readings.pop(0)
        self.over.set()
        return self.readings[0]


def turns(*readings):
    """How often it is said that the unit turns."""
    unit, said = Unit(*readings), []
    poller = Poller(unit, period_s=0.001)
    poller.on_motion(lambda: said.append(1))
    with poller:
        assert unit.over.wait(20.0)
    return len(said)


def test_a_unit_that_stands_is_not_told():
    assert turns(*(reading(k, 0.1 + 1e-4 * (k % 2)) for k in range(5))) == 0


def test_a_unit_that_turns_is_told_each_time():
    assert turns(reading(0, 0.1), reading(1, 0.2), reading(2, 0.3), reading(3, 0.3)) == 2
    assert turns(reading(0, 0.1, 0.2), reading(1, 0.1, 0.25)) == 1


def test_a_unit_that_is_lost_may_turn(monkeypatch):
    monkeypatch.setattr("robot_agent.pan_tilt.poller.PAUSE_S", 0.001)
    assert turns(reading(0, 0.1), GONE, GONE, reading(9, 0.5), reading(10, 0.5)) == 1
