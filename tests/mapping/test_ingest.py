import random

import msgspec
import pytest
from msgspec.structs import replace

from tagmap.arbitration.grants import Grants
from tagmap.arbitration.rules import Rules
from tagmap.mapper import Mapper
from tagmap.mapping.draft import Arrival, Draft
from tagmap.mapping.ingest import Ingest
from tests.mapping.messages import SESSION, encode, hello, keyframe, spatial_keyframe

NOON_NS = 1_770_000_000_000_000_000


def feed(ingest, *messages, robot="r1"):
    draft = Draft()
    for message in messages:
        payload = message if isinstance(message, bytes) else encode(message)
        ingest.take(Arrival(robot, payload), draft)
    return draft


def session_of(ingest, robot="r1", session=SESSION):
    return ingest.robots[robot].sessions[session]


def reasons(draft):
    return [refused.reason for refused in draft.refused.values()]


def counters(ingest, robot="r1"):
    return ingest.robots[robot].counters


def test_stores_each_keyframe_once():
    ingest = Ingest("site")
    first = feed(ingest, hello(), keyframe(1), keyframe(2))
    again = feed(ingest, keyframe(1), hello())
    assert [k.seq for k in first.keyframes] == [1, 2]
    assert again.keyframes == []
    assert again.hellos == []
    assert counters(ingest).duplicates == 2
    assert session_of(ingest).ack().contiguous == 2


def test_a_duplicate_is_acknowledged_again():
    ingest = Ingest("site")
    feed(ingest, hello(), keyframe(1))
    assert feed(ingest, keyframe(1)).touched == {("r1", SESSION): [1]}


@pytest.mark.parametrize("seed", range(5))
def test_the_result_does_not_depend_on_the_order_of_arrival(seed):
    messages = [hello(), *(keyframe(i) for i in range(1, 20))]
    shuffled = [*messages, *messages[3:7]]
    random.Random(seed).shuffle(shuffled)
    ingest = Ingest("site")
    draft = feed(ingest, *shuffled)
    assert sorted(k.seq for k in draft.keyframes) == list(range(1, 20))
    assert session_of(ingest).contiguous == 19
    assert not session_of(ingest).beyond


def test_keyframes_before_their_hello_wait_for_it():
    ingest = Ingest("site")
    assert len(feed(ingest, keyframe(1), keyframe(2)).keyframes) == 2
    assert session_of(ingest).ack().contiguous == -1
    feed(ingest, hello())
    assert session_of(ingest).ack().contiguous == 2


def test_keyframes_before_their_hello_are_judged_by_it():
    ingest = Ingest("site")
    feed(ingest, spatial_keyframe(1), keyframe(2))
    draft = feed(ingest, hello())
    assert counters(ingest).withdrawn == 1
    assert [(r.seq, r.reason) for r in draft.refused.values()] == [
        (1, "a spatial keyframe in a planar session")
    ]
    assert session_of(ingest).contiguous == 2


def test_the_robot_is_the_keys():
    ingest = Ingest("site")
    draft = feed(ingest, keyframe(3, robot="r2"), robot="r1")
    assert reasons(draft) == ["names robot r2, the key names r1"]
    assert "r2" not in ingest.robots
    assert session_of(ingest).refusals == {3: "names robot r2, the key names r1"}


def test_another_site_is_refused():
    draft = feed(Ingest("site"), hello(site="elsewhere"))
    assert reasons(draft)[0] == "names site elsewhere, this is site"


def test_two_robots_with_one_number():
    ingest = Ingest("site")
    feed(ingest, hello(robot="r1", number=7))
    draft = feed(ingest, hello(robot="r2", number=7, session="session-0002"), robot="r2")
    assert reasons(draft)[0] == "number 7 belongs to robot r1"
    assert draft.hellos == []


def test_a_robot_keeps_its_number():
    ingest = Ingest("site")
    feed(ingest, hello(number=7))
    draft = feed(ingest, hello(number=8, session="session-0002"))
    assert reasons(draft)[0] == "number 8, this robot has number 7"


def test_the_first_hello_decides_the_kind_of_the_site():
    ingest = Ingest("site")
    feed(ingest, hello())
    feed(ingest, hello("r2", 2, "session-0002", kind="spatial"), robot="r2")
    draft = feed(ingest, spatial_keyframe(1, robot="r2", session="session-0002"), robot="r2")
    index = session_of(ingest, "r2", "session-0002")
    assert ingest.kind == "planar"
    assert index.refused == "a spatial session, the site is planar"
    assert reasons(draft)[0].startswith("the session is refused: a spatial session")
    assert index.ack().contiguous == 1
    assert [r.seq for r in index.full_ack().refused] == [1, 0]


def test_pixels_need_a_rig():
    ingest = Ingest("site")
    feed(ingest, hello(kind="spatial"))
    draft = feed(ingest, spatial_keyframe(1, form="mono_px"))
    assert reasons(draft)[0] == "sightings[0] is mono_px, but the hello carries no rig"


def test_unknown_version_is_refused_with_the_reason():
    ingest = Ingest("site")
    draft = feed(ingest, hello(), msgspec.structs.replace(keyframe(1), v=2))
    assert reasons(draft)[0] == "unsupported schema version 2, expected 1"
    assert session_of(ingest).contiguous == 1
    assert counters(ingest).refused == 1


@pytest.mark.parametrize("payload", [b"", b"\xc1", b"\x80", encode(keyframe(1))[:40]])
def test_malformed_bytes_are_counted_and_settle_nothing(payload):
    ingest = Ingest("site")
    draft = feed(ingest, payload)
    assert counters(ingest).malformed == 1
    assert draft.touched == {}
    assert ingest.robots["r1"].sessions == {}


def test_contradictions_are_counted_and_change_nothing():
    ingest = Ingest("site")
    feed(ingest, hello(), keyframe(1))
    draft = feed(ingest, keyframe(1, x_m=9.0))
    assert draft.keyframes == []
    assert (counters(ingest).duplicates, counters(ingest).contradictions) == (1, 1)


def test_a_valid_keyframe_outlives_a_spoilt_copy_in_either_order():
    spoilt = msgspec.structs.replace(keyframe(1), v=2)
    for order in ((spoilt, keyframe(1)), (keyframe(1), spoilt)):
        ingest = Ingest("site")
        draft = feed(ingest, hello(), *order)
        assert [k.seq for k in draft.keyframes] == [1]
        assert session_of(ingest).full_ack().refused == ()


def test_an_acceptable_hello_heals_a_refused_session():
    ingest = Ingest("site")
    feed(ingest, msgspec.structs.replace(hello(), v=9))
    assert session_of(ingest).refused is not None
    draft = feed(ingest, hello(), keyframe(1))
    assert len(draft.keyframes) == 1
    assert session_of(ingest).full_ack().refused == ()


def test_what_is_too_far_ahead_is_neither_stored_nor_settled():
    ingest = Ingest("site")
    draft = feed(ingest, hello(), keyframe(2**50, t_ns=1))
    assert draft.keyframes == []
    assert counters(ingest).postponed == 1
    assert session_of(ingest).beyond == set()


def test_counters_add_up():
    ingest = Ingest("site")
    far = keyframe(2**50, t_ns=1)
    feed(ingest, hello(), keyframe(1), keyframe(1), b"x", keyframe(2, site="no"), far)
    counts = counters(ingest).as_dict()
    assert (counts.pop("contradictions"), counts.pop("withdrawn")) == (0, 0)
    assert counts.pop("received") == sum(counts.values())


def test_of_many_sessions_without_hello_the_oldest_are_forgotten(monkeypatch):
    monkeypatch.setattr("tagmap.mapping.ledger.MAX_UNOPENED", 3)
    ingest = Ingest("site")
    feed(ingest, hello(session="session-open"))
    for i in range(5):
        assert len(feed(ingest, keyframe(1, session=f"session-000{i}")).keyframes) == 1
    kept = ["session-open", "session-0002", "session-0003", "session-0004"]
    assert list(ingest.robots["r1"].sessions) == kept


def test_only_the_newest_sessions_remember_their_keyframes(monkeypatch):
    monkeypatch.setattr("tagmap.mapping.ledger.MAX_REMEMBERED", 2)
    ingest = Ingest("site")
    names = [f"session-000{i}" for i in range(4)]
    for name in names:
        feed(ingest, hello(session=name), keyframe(1, session=name))
    remembered = [len(session_of(ingest, session=name).hashes) for name in names]
    assert remembered == [0, 0, 1, 1]


def test_keyframes_are_held_only_until_somebody_follows_them():
    mapper = Mapper("site")
    mapper.step([Arrival("r1", encode(keyframe(1)))])
    index = session_of(mapper.ingest)
    assert list(index.recent) == [1]
    mapper.step([Arrival("r1", encode(one)) for one in (hello(), keyframe(2))])
    assert not index.recent
    assert sorted(index.hashes) == [1, 2]


def test_an_ack_lists_the_newest_refusals_and_stays_small():
    ingest = Ingest("site")
    feed(ingest, hello(), *(keyframe(i, site="no") for i in range(1, 1200)))
    ack = session_of(ingest).full_ack()
    assert ack.contiguous == 1199
    assert ack.refused[0].seq == 1199
    assert len(encode(ack)) < 65536


def test_an_ack_tells_each_refusal_once_and_again_when_it_is_sent_again():
    ingest = Ingest("site")
    feed(ingest, keyframe(1, site="no"))
    assert session_of(ingest).ack([1]).refused == ()
    feed(ingest, hello())
    assert [r.seq for r in session_of(ingest).ack([0]).refused] == [1]
    assert session_of(ingest).ack([0]).refused == ()
    assert [r.seq for r in session_of(ingest).ack([1]).refused] == [1]


@pytest.mark.parametrize(
    ("id_by", "lease", "reason"),
    [
        ("laser", 0, None),
        ("laser", None, None),
        ("track", 99, None),
        ("laser", 99, f"sightings[0]: lease {NOON_NS + 99} was never granted"),
    ],
)
def test_identified_by_laser_under_a_lease(id_by, lease, reason):
    """`lease` counts from that which was granted."""
    ingest = Ingest("site")
    ingest.grants = Grants(Rules(), NOON_NS)
    granted = ingest.grants.add("r1", 1.0, NOON_NS)
    lit = keyframe(1, t_ns=NOON_NS)
    number = None if lease is None else granted + lease
    sighting = replace(lit.sightings[0], id_by=id_by, lease=number)
    draft = feed(ingest, hello(), replace(lit, sightings=(sighting,)))
    assert reasons(draft) == ([] if reason is None else [reason])
    ingest.grants = None
    assert reasons(feed(ingest, replace(lit, seq=2, sightings=(sighting,)))) == []
