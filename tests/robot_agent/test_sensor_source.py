"""Observations handed from the cycle to delivery."""

from robot_agent.sources.sensors import SensorSource
from tagmap.records import Introduction, Observation, Transform

AT_BASE = Transform(p_m=(0.0, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0))


def observation(n):
    return Observation(t_ns=n, odom=None, T_base_cam=AT_BASE, sightings=())


def test_in_order_and_once():
    source = SensorSource(Introduction(kind="spatial", rig=None), "20261130t000000-abc")
    source.seek(0)
    for n in range(5):
        source.put(observation(n))
    assert [o.t_ns for o in source.take(3, 0)] == [0, 1, 2]
    source.end()
    assert not source.exhausted
    assert [o.t_ns for o in source.take(3, 0)] == [3, 4]
    assert source.exhausted
    assert source.take(3, 0) == []


def test_no_two_sessions_are_one_source():
    hello = Introduction(kind="spatial", rig=None)
    a, b = SensorSource(hello, "session-a"), SensorSource(hello, "session-b")
    assert a.fingerprint != b.fingerprint
    assert not a.patient
