"""Thousands of spoilt messages: the service lives, counts them, and serves those who are sound."""

import random

import pytest

from tests.mapping.messages import SESSION, encode, hello, keyframe
from tests.service.spoil import spoilt

MESSAGES = 4000


@pytest.mark.parametrize("seed", [1])
def test_a_flood_of_spoilt_messages(client, eventually, seed):
    rng = random.Random(seed)
    sound = [encode(hello()), *(encode(keyframe(seq)) for seq in range(1, 9))]
    flood = [spoilt(rng.choice(sound), rng) for _ in range(MESSAGES)]
    for start in range(0, MESSAGES, 500):
        client.send(*flood[start : start + 500])
        client.admin("site", "status")
    ack = client.deliver(hello(), *(keyframe(seq) for seq in range(1, 9)))
    assert ack.contiguous == 8
    assert all(refusal.seq > 8 for refusal in ack.refused)

    def counters():
        return client.admin("site", "status")["counters"]

    def all_received():
        """A put may be dropped on a busy link; what is missing is made up for."""
        missing = MESSAGES - counters()["received"]
        client.send(*flood[: min(max(missing, 0), 50)])
        return missing <= 0

    eventually(all_received)
    counts = counters()
    assert counts["malformed"] > MESSAGES / 20
    assert counts["refused"] > MESSAGES / 20
    shown = client.admin("robots", "show", robot="r1")
    assert all(refusal["reason"] for refusal in shown["refusals"])
    assert shown["sessions"][0]["session"] == SESSION or len(shown["sessions"]) > 1


def test_a_flood_does_not_flood_the_log(serve, client):
    client.send(*[b"\xc1"] * 1000)
    client.deliver(hello(), keyframe(1))
    client.admin("site", "status")
    assert serve.log.read_text().count('"malformed"') < 50
