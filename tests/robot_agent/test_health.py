"""Which devices work: what changes is told, once."""

import json

import pytest

from robot_agent.health import Health
from tagmap import logs


@pytest.fixture
def told(capsys):
    logs.configure()
    return lambda: [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def test_a_trouble_is_told_once_and_its_end_once(told):
    health = Health("r1")
    for trouble in (None, "unplugged", "unplugged", "still unplugged", None, None, "again"):
        health.note("cameras", trouble)
    events = [(event["event"], event.get("reason"), event["level"]) for event in told()]
    assert events == [
        ("cameras: failed, going on without", "unplugged", "warning"),
        ("cameras: works again", None, "info"),
        ("cameras: failed, going on without", "again", "warning"),
    ]
    assert health.troubles == {"cameras": "again"}


def test_devices_are_told_apart(told):
    health = Health("r1")
    health.note("cameras", "a")
    health.note("odometry", "b")
    health.note("cameras", None)
    assert health.troubles == {"odometry": "b"}
    assert len(told()) == 3


def test_what_the_interlock_says_is_written_later_for_a_signal_may_make_it_speak(told):
    health = Health("r1")
    health.tell("laser off: the mount moved")
    assert not told()
    health.write()
    [event] = told()
    assert (event["event"], event["reason"], event["robot"]) == (
        "laser",
        "laser off: the mount moved",
        "r1",
    )
