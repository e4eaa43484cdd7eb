"""The real service over the real link: what the wire contract promises."""

import json
import os
import signal

import msgspec
import pytest

from tagmap.records import (
    IdentifiedMeasurement,
    LocalizeReply,
    LocalizeRequest,
    MapVersion,
    Pose,
    Tag,
    Transform,
    decode,
    encode,
)
from tagmap.store import SiteStore
from tagmap.store.check import check
from tests.mapping.messages import SESSION, hello, keyframe
from tests.mapping.world import TAGS, T_map_base, drive, seen

N = 30


@pytest.fixture
def mapped(client):
    """A service that has mapped the room on its surveyed tags."""
    for tag in ("1", "2", "3"):
        x_m, y_m = TAGS[tag]
        client.admin(
            "tags", "survey", tag=tag, x_m=float(x_m), y_m=float(y_m), z_m=0.0, sigma_m=1e-3
        )
    client.deliver(hello(), *(drive(seq) for seq in range(1, N + 1)))
    client.admin("map", "solve")
    return client


def heard(client, key, record):
    return [decode(record, payload) for where, payload in list(client.heard) if where == key]


def test_from_sightings_to_a_map_and_poses(mapped, eventually):
    status = mapped.admin("site", "status")
    assert (status["gauge"], status["keyframes"], status["tags"]) == ("anchored", N, 4)
    key = mapped.keys.pose("r1")
    eventually(lambda: any(pose.state == "good" for pose in heard(mapped, key, Pose)))
    pose = next(pose for pose in reversed(heard(mapped, key, Pose)) if pose.state == "good")
    assert pose.T_map_base.p_m == pytest.approx(tuple(T_map_base(N)[:2, 2]), abs=0.02)
    versions = heard(mapped, mapped.keys.map_version(), MapVersion)
    assert versions[-1].version == status["map_version"]
    tag = heard(mapped, mapped.keys.map_tag("4"), Tag)[-1]
    assert tag.p_m == pytest.approx(tuple(TAGS["4"]), abs=0.02)
    assert tag.state == "mapped"


def test_tags_can_be_asked_for(mapped):
    keys = mapped.keys
    (reply,) = mapped.ask(keys.map_tags())
    assert reply.key == keys.map_tags()
    tags = msgspec.msgpack.decode(reply.payload, type=list[Tag])
    assert [tag.tag for tag in tags] == ["1", "2", "3", "4"]
    (reply,) = mapped.ask(keys.map_tag("2"))
    assert decode(Tag, reply.payload) == tags[1]
    replies = mapped.ask(keys.map_tag())
    assert sorted(reply.key for reply in replies) == [keys.map_tag(t) for t in "1234"]
    (reply,) = mapped.ask(f"{keys.map_tags()}?bbox=0,0,9,9;state=surveyed")
    assert [tag["tag"] for tag in msgspec.msgpack.decode(reply.payload)] == ["1"]
    (reply,) = mapped.ask(f"{keys.map_tags()}?version={tags[0].version}")
    assert len(msgspec.msgpack.decode(reply.payload)) == 4


def test_the_map_version_can_be_asked_for(mapped):
    (reply,) = mapped.ask(mapped.keys.map_version())
    version = decode(MapVersion, reply.payload)
    assert encode(version) in [payload for key, payload in mapped.heard if key == reply.key]


def test_poses_can_be_asked_for(mapped):
    key = mapped.keys.pose("r1")
    (reply,) = mapped.ask(key)
    assert decode(Pose, reply.payload).T_map_base is not None
    t_ns = drive(10).t_ns + 50_000_000
    (reply,) = mapped.ask(f"{key}?t_ns={t_ns}")
    pose = decode(Pose, reply.payload)
    assert pose.t_ns == t_ns
    assert pose.T_map_base.p_m == pytest.approx((0.95, 0.0), abs=0.02)
    (reply,) = mapped.ask(f"{key}?t_ns={drive(N).t_ns + 1}")
    assert f"{drive(1).t_ns}..{drive(N).t_ns}" in reply.error


def test_localize(mapped):
    measurements = tuple(
        IdentifiedMeasurement(tag=tag, z=seen(T_map_base(4), tag, p).z) for tag, p in TAGS.items()
    )
    request = LocalizeRequest(
        kind="planar",
        T_base_cam=Transform(p_m=(0.0, 0.0), theta_rad=0.0),
        measurements=measurements,
    )
    (reply,) = mapped.ask(mapped.keys.localize(), encode(request))
    answer = decode(LocalizeReply, reply.payload)
    assert answer.T_map_base.p_m == pytest.approx((0.3, 0.0), abs=0.02)
    assert answer.state == "good"


def test_bad_questions_get_an_error(client):
    root, keys = client.keys.root, client.keys
    for selector, said in {
        f"{keys.map_tags()}?bbox=1,2": "bbox",
        f"{keys.map_tags()}?version=7": "no map version 7",
        f"{keys.map_tag('99')}": "99",
        f"{keys.pose('r9')}": "no pose",
        f"{keys.pose('r9')}?t_ns=soon": "t_ns",
        f"{keys.ack('r9')}": "nothing was heard",
        f"{root}/robots/No Name/ack": "names no robot",
        f"{keys.localize()}": "malformed",
    }.items():
        (reply,) = client.ask(selector)
        assert reply.error is not None, selector
        assert said in reply.error
    (reply,) = client.ask(keys.admin("make", "coffee"))
    assert b"unknown command make coffee" in reply.payload
    (reply,) = client.ask(keys.admin("tags", "list"), b"\xc1")
    assert b"malformed" in reply.payload
    assert client.admin("site", "status")["site"] == "site"


def test_acks_of_sessions_heard_of_or_not(client):
    assert client.ack("session-none").contiguous == -1
    client.deliver(hello(), keyframe(1), keyframe(2, site="elsewhere"), keyframe(3))
    ack = client.ack(SESSION)
    assert (ack.contiguous, [r.seq for r in ack.refused]) == (3, [2])


def test_what_was_acknowledged_survives_kill_and_terminate(serve, client):
    frames = [hello(), *(drive(seq) for seq in range(1, N + 1))]
    client.deliver(*frames[: N // 2])
    serve.kill()
    serve.start()
    assert client.ack(SESSION).contiguous >= N // 2 - 1
    client.deliver(*frames)
    client.admin("map", "solve")
    assert serve.stop() == 0
    path = serve.folder / "site.db"
    assert check(path) == []
    with SiteStore.open(path, read_only=True) as store:
        assert store.settled("r1", SESSION) == list(range(N + 1))
        assert store.counts().keyframes == N
        assert len(store.tags()) == 4
    serve.start()
    (reply,) = client.ask(client.keys.pose("r1"))
    assert decode(Pose, reply.payload).t_ns == drive(N).t_ns
    assert client.admin("site", "status")["solver"]["pending"] is False


def test_a_version_is_made_only_when_something_changed(mapped):
    first = mapped.admin("map", "solve")
    second = mapped.admin("map", "solve")
    assert first["version"] == second["version"]
    mapped.deliver(hello(session="session-0002"))
    assert mapped.admin("map", "solve")["version"] == first["version"]
    mapped.deliver(drive(N + 1))
    assert mapped.admin("map", "solve")["version"] == first["version"] + 1
    causes = [version["cause"] for version in mapped.admin("map", "versions")["versions"]]
    assert causes[0] == "first map"
    assert causes[-1] == "1 more keyframes"


def test_router_and_solver_are_replaced_when_they_die(serve, mapped, eventually):
    children = {
        name: pid
        for pid in map(int, children_of(serve.process.pid))
        for name in ("router", "worker")
        if name in command_of(pid)
    }
    for pid in children.values():
        os.kill(pid, signal.SIGKILL)
    mapped.deliver(drive(N + 1), drive(N + 2))
    assert mapped.admin("map", "solve")["summary"]["keyframes"] == N + 2
    eventually(lambda: len(children_of(serve.process.pid)) == 2)
    assert "router ended" in serve.log.read_text()


def children_of(pid):
    with open(f"/proc/{pid}/task/{pid}/children") as file:
        return file.read().split()


def command_of(pid):
    with open(f"/proc/{pid}/cmdline") as file:
        return file.read()


def test_the_log_is_json_with_one_event_a_line(serve, client):
    client.deliver(hello(), keyframe(1, site="elsewhere"))
    assert serve.stop() == 0
    events = [json.loads(line) for line in serve.log.read_text().splitlines()]
    named = {event["event"] for event in events}
    assert {"serving", "hello accepted", "refused", "stopping"} <= named
    refused = next(event for event in events if event["event"] == "refused")
    assert (refused["robot"], refused["seq"]) == ("r1", 1)
