"""The cycle in its thread: what it says goes on its way, and what it fails of ends the robot."""

import json
import threading
from types import SimpleNamespace

import pytest

from robot_agent import sensing as module
from robot_agent.agent import Report
from robot_agent.cameras.camera import Failure
from robot_agent.sensing import Sensing
from robot_agent.sources.sensors import SensorSource
from tagmap import logs
from tagmap.records import Introduction, JobResult, Observation, Pose, Transform

AT = Transform(p_m=(0.0, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0))
OBSERVATION = Observation(t_ns=1, odom=None, T_base_cam=AT, sightings=())
RESULT = JobResult(robot="r1", job=1, tag="a", outcome="expired", read=None)
POSE = Pose(
    T_map_base=None,
    T_map_odom=None,
    robot_session="session-0001",
    cov=None,
    map_version=None,
    gauge="floating",
    state="lost",
    dop=None,
    protection_level_m=None,
    source="agent",
    t_ns=1,
)


class Uplink:
    def __init__(self):
        self.poses, self.results = [], []

    def publish_pose(self, pose):
        self.poses.append(pose)

    def publish_result(self, result):
        self.results.append(result)


class Robot:
    """Plays what it is given, then its recording is over."""

    def __init__(self, *cycles):
        self.cycles, self.failure = list(cycles), None

    def cycle(self):
        if not self.cycles:
            self.failure = Failure("ended", "the recording is over")
            return None
        one = self.cycles.pop(0)
        if isinstance(one, Exception):
            raise one
        return one() if callable(one) else one


@pytest.fixture
def told(capsys):
    logs.configure()
    return lambda: [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def new(robot, stopped=None):
    source = SensorSource(Introduction(kind="spatial", rig=None), "session-0001")
    uplink = Uplink()
    stop = (lambda: stopped.set()) if stopped else (lambda: None)
    return SimpleNamespace(
        source=source, uplink=uplink, sensing=Sensing(robot, source, uplink, "r1", stop)
    )


def test_what_a_cycle_says_goes_on_its_way(eventually):
    one = new(Robot(Report(OBSERVATION, POSE, (RESULT,)), None, Report(None, POSE)))
    with one.sensing as sensing:
        eventually(lambda: one.source._ended)
    assert one.source.take(9, 0) == [OBSERVATION]
    assert one.source.exhausted
    assert (len(one.uplink.poses), one.uplink.results) == (2, [RESULT])
    assert sensing.fault is None


def test_a_fault_ends_the_robot_also_without_a_service(told, eventually):
    stopped = threading.Event()
    one = new(Robot(Report(OBSERVATION, POSE), ZeroDivisionError("oh")), stopped)
    with one.sensing as sensing:
        eventually(stopped.is_set)
    assert isinstance(sensing.fault, ZeroDivisionError)
    [event] = [event for event in told() if event["event"] == "the cycle failed"]
    assert "ZeroDivisionError" in event["exception"]


def test_a_cycle_that_hangs_ends_the_robot(monkeypatch, eventually):
    monkeypatch.setattr(module, "HANGS_S", 0.05)
    monkeypatch.setattr(module, "LOOK_S", 0.01)
    stopped, release = threading.Event(), threading.Event()
    one = new(Robot(lambda: release.wait(20.0) and None), stopped)
    with one.sensing as sensing:
        eventually(stopped.is_set)
        assert "under way" in str(sensing.fault)
        release.set()


def test_a_cycle_that_does_not_end_does_not_hold_up_the_end(monkeypatch):
    monkeypatch.setattr(module, "END_S", 0.05)
    release, began = threading.Event(), threading.Event()

    def hangs():
        began.set()
        release.wait(20.0)

    one = new(Robot(hangs))
    with one.sensing as sensing:
        began.wait(20.0)
    assert "does not end" in str(sensing.fault)
    release.set()


def test_a_recording_that_is_over_does_not_hang(monkeypatch, eventually):
    """However long what it has seen is delivered."""
    looked: list[int] = []
    monkeypatch.setattr(module, "LOOK_S", 0.005)
    one = new(Robot())
    with one.sensing as sensing:
        eventually(lambda: not sensing._thread.is_alive())
        monkeypatch.setattr(module, "HANGS_S", -1.0)
        sensing._thread.is_alive = lambda: looked.append(1) or False
        eventually(lambda: len(looked) > 2)
    assert sensing.fault is None
