"""Leases over the real link: granted to one at a time, not right after a start, and refused once
they have lapsed."""

import time

from tagmap.arbitration.rules import SECOND_NS, Rules
from tagmap.records import LeaseReply, LeaseRequest, Limits, Measurement, Sighting, decode, encode
from tests.mapping.messages import COV_2, SESSION, hello, keyframe

RULES = Rules()
PATIENCE_S = 30.0


def ask(client, robot, wanted_s=RULES.max_lease_s, **fields):
    request = LeaseRequest(robot=robot, wanted_s=wanted_s, **fields)
    (reply,) = client.ask(client.keys.lease(), encode(request))
    assert reply.error is None, reply.error
    return decode(LeaseReply, reply.payload)


def acquire(client, robot, **fields):
    """The reply that grants, and a time before which it was asked for."""
    give_up_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < give_up_s:
        asked_s = time.monotonic()
        reply = ask(client, robot, **fields)
        if reply.lease is not None:
            return reply, asked_s
        assert 0.0 < reply.retry_s <= RULES.ask_again_s
        time.sleep(reply.retry_s)
    raise AssertionError(f"{robot} gets no lease")


def introduce(client, *robots, **fields):
    for number, robot in enumerate(robots, 1):
        client.robot = robot
        client.deliver(hello(robot, number, f"session-{robot}", **fields))
    client.robot = robots[0]


def lit(lease, t_ns, seq, tag="6"):
    z = Measurement(point_cam_m=(1.0, 0.0), cov=COV_2)
    sighting = Sighting(tag=tag, id_by="laser", p_false=1e-6, lease=lease, z=z)
    return keyframe(seq, t_ns=t_ns, sightings=(sighting,))


def test_one_robot_after_the_other(client):
    introduce(client, "r1", "r2")
    first, asked_s = acquire(client, "r1")
    assert first.valid_s == RULES.max_lease_s
    others = ask(client, "r2")
    # Only while the first lease is certainly in force: this machine may be slow.
    if time.monotonic() - asked_s < first.valid_s:
        assert others.lease is None
    assert ask(client, "r1", wanted_s=0.0, done=first.lease).lease is None
    second, _ = acquire(client, "r2")
    assert second.lease > first.lease
    ask(client, "r2", wanted_s=0.0, done=second.lease)


def test_far_apart_at_once(client):
    introduce(client, "r1", "r2", limits=Limits(reader_range_m=20.0))
    acquire(client, "r1", p_m=(0.0, 0.0), radius_m=0.5)
    assert ask(client, "r2", p_m=(70.0, 0.0), radius_m=0.5).lease is not None


def test_who_said_no_hello_gets_none(client):
    for payload, said in (
        (encode(LeaseRequest(robot="r9", wanted_s=1.0)), "robot r9 has not said hello"),
        (b"\xc1", "malformed"),
        (None, "malformed"),
    ):
        (reply,) = client.ask(client.keys.lease(), payload)
        assert said in reply.error


def test_silence_after_a_restart(serve, client):
    """A lease's number is the time in ns at which it was granted."""
    introduce(client, "r1", "r2")
    before, _ = acquire(client, "r1")
    serve.kill()
    restarted_ns = time.time_ns()
    serve.start()
    after, _ = acquire(client, "r2")
    silence_ns = round(RULES.withheld_s(RULES.max_lease_s) * SECOND_NS)
    assert after.lease >= restarted_ns + silence_ns
    assert after.lease >= before.lease + silence_ns


def test_identified_without_a_lease_in_force(client):
    client.deliver(hello())
    lease = acquire(client, "r1")[0].lease
    client.deliver(
        hello(),
        lit(lease, lease, 1),
        lit(lease, lease + 60 * SECOND_NS, 2),
        lit(lease + 1, lease, 3),
        lit(None, lease, 4),
        lit(1, 60 * SECOND_NS, 5),
    )
    reasons = {refusal.seq: refusal.reason for refusal in client.ack(SESSION).refused}
    assert sorted(reasons) == [2, 3, 5]
    assert reasons[2] == f"sightings[0]: lease {lease} was over 58.0 s before the keyframe"
    assert reasons[3] == f"sightings[0]: lease {lease + 1} was never granted"
    assert reasons[5] == "sightings[0]: lease 1 was over 58.0 s before the keyframe"
