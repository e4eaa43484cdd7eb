"""Observations handed from the cycle to delivery."""

import numpy as np

from robot_agent.sources import sensors
from robot_agent.sources.sensors import SensorSource
from tagmap.records import Introduction, Observation, Odometry, Transform

AT_BASE = Transform(p_m=(0.0, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0))
STEP = Odometry(T_prev_cur=AT_BASE, cov=tuple(np.eye(6)[np.triu_indices(6)]))


def observation(n, odom=None):
    return Observation(t_ns=n, odom=odom, T_base_cam=AT_BASE, sightings=())


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


def test_without_anybody_who_takes_them_some_are_dropped_and_the_chain_is_cut(monkeypatch):
    monkeypatch.setattr(sensors, "MOST_WAITING", 3)
    source = SensorSource(Introduction(kind="spatial", rig=None), "session-0001")
    for n in range(5):
        source.put(observation(n, STEP))
    assert source.dropped == 2
    assert [o.t_ns for o in source.take(9, 0)] == [0, 1, 2]
    source.put(observation(5, STEP))
    source.put(observation(6, STEP))
    assert [(o.t_ns, o.odom) for o in source.take(9, 0)] == [(5, None), (6, STEP)]
