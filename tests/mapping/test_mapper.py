import numpy as np
import pytest

from tagmap.errors import RecordRefused
from tagmap.mapper import Mapper
from tagmap.mapping.draft import Arrival
from tagmap.records import Ack, IdentifiedMeasurement, LocalizeRequest, Transform
from tests.mapping.messages import SESSION, encode, hello, keyframe, spatial_keyframe
from tests.mapping.world import TAGS, T_map_base, seen, solution


def arrivals(*messages):
    return [Arrival(message.robot, encode(message)) for message in messages]


def test_a_step_says_what_to_store_and_what_to_acknowledge():
    outcome = Mapper("site").step(arrivals(hello(), keyframe(1), keyframe(2, site="x")))
    assert outcome.has_facts
    assert [k.seq for k in outcome.keyframes] == [1]
    assert [r.seq for r in outcome.refused] == [2]
    (robot, ack), *others = outcome.acks
    assert (robot, ack.session, ack.contiguous, others) == ("r1", SESSION, 2, [])
    assert [r.seq for r in ack.refused] == [2]


def test_duplicates_are_acknowledged_without_anything_to_store():
    mapper = Mapper("site")
    mapper.step(arrivals(hello(), keyframe(1)))
    outcome = mapper.step(arrivals(keyframe(1)))
    assert not outcome.has_facts
    assert outcome.acks == [("r1", Ack(session=SESSION, contiguous=1))]


def test_acks_can_be_asked_for():
    mapper = Mapper("site")
    assert mapper.ack("r1") is None
    assert mapper.ack("r1", SESSION) == Ack(session=SESSION, contiguous=-1)
    mapper.step(arrivals(hello(), keyframe(1)))
    mapper.step(arrivals(hello(session="session-0002")))
    assert mapper.ack("r1").session == "session-0002"
    assert mapper.ack("r1", SESSION).contiguous == 1


def request(*tags, kind="planar", **fields):
    measurements = tuple(
        IdentifiedMeasurement(tag=tag, z=seen(T_map_base(4), tag, TAGS.get(tag, np.zeros(2))).z)
        for tag in tags
    )
    T_base_cam = Transform(p_m=(0.0, 0.0), theta_rad=0.0)
    parts = {"kind": kind, "T_base_cam": T_base_cam, "measurements": measurements}
    return LocalizeRequest(**(parts | fields))


def test_localize():
    mapper = Mapper("site")
    mapper.adopt(solution(), "first map", 1)
    reply = mapper.localize(request("1", "2", "unknown", "3"))
    assert reply.T_map_base.p_m == pytest.approx((0.3, 0.0), abs=1e-9)
    assert reply.inliers == ("1", "2", "3")
    assert (reply.state, reply.gauge, reply.map_version) == ("good", "anchored", 1)


def test_localize_says_what_is_missing():
    mapper = Mapper("site")
    reply = mapper.localize(request("1", "2"))
    assert (reply.T_map_base, reply.state, reply.map_version) == (None, "lost", None)
    assert "mapped tag" in reply.missing


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        (request("1", kind="spatial"), "a spatial request, the site is planar"),
        (
            request("1", T_base_cam=Transform(p_m=(0.0, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0))),
            "T_base_cam is spatial",
        ),
        (
            request(
                measurements=(
                    IdentifiedMeasurement(
                        tag="1", z=spatial_keyframe(1, form="mono_px").sightings[0].z
                    ),
                )
            ),
            "mono_px, which a planar problem cannot use",
        ),
        (
            request(
                measurements=(IdentifiedMeasurement(tag="1", z=spatial_keyframe(1).sightings[0].z),)
            ),
            "point_cam_m has 3 numbers",
        ),
    ],
)
def test_localize_refuses_what_cannot_be_asked(asked, reason):
    mapper = Mapper("site")
    mapper.step(arrivals(hello()))
    with pytest.raises(RecordRefused, match=reason):
        mapper.localize(asked)


def test_status_counts_all_robots():
    mapper = Mapper("site")
    mapper.presence("r1", True)
    mapper.step(arrivals(hello(), keyframe(1), hello("r2", 2)))
    mapper.step([Arrival("", b""), Arrival("r2", b"")])
    status = mapper.status()
    assert (status["kind"], status["gauge"], status["alive"]) == ("planar", "floating", 1)
    counters = status["counters"]
    assert (counters["received"], counters["stored"], counters["hellos"]) == (4, 1, 2)
    assert (counters["malformed"], counters["stray"]) == (1, 1)


def test_a_step_survives_sessions_that_it_forgets_itself(monkeypatch):
    monkeypatch.setattr("tagmap.mapping.ledger.MAX_UNOPENED", 2)
    frames = [keyframe(1, session=f"session-000{i}") for i in range(6)]
    outcome = Mapper("site").step(arrivals(*frames))
    assert len(outcome.keyframes) == 6
    assert [ack.session for _, ack in outcome.acks] == ["session-0004", "session-0005"]
