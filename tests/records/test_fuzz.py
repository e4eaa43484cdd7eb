"""Mutated messages give a valid record or RecordRefused, and nothing else."""

import math
import random
from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from tagmap.errors import RecordRefused
from tagmap.records import address_of, decode, encode
from tagmap.records.base import Message
from tagmap.records.codec import MAX_BYTES
from tests.records.examples import EXAMPLES

PER_EXAMPLE = 600
ENCODED = {name: encode(message) for name, message in EXAMPLES.items()}
ODD_VALUES: list[Any] = [
    None, True, 0, -1, 2**63 - 1, 2**64 - 1, -(2**63), 0.0, -0.0, 1e308, 5e-324, math.nan,
    math.inf, -math.inf, "", "x" * 300, "\x00", "é\n", b"", b"\xff" * 600, [], {}, [[[]]],
    [math.nan] * 4, {"v": 1}, [0.0] * 300,
]  # fmt: skip


def _flip_bits(rng: random.Random, payload: bytes) -> bytes:
    mutated = bytearray(payload)
    for _ in range(rng.randint(1, 8)):
        mutated[rng.randrange(len(mutated))] ^= 1 << rng.randrange(8)
    return bytes(mutated)


def _truncate(rng: random.Random, payload: bytes) -> bytes:
    return payload[: rng.randrange(len(payload))]


def _splice(rng: random.Random, payload: bytes) -> bytes:
    other = rng.choice(list(ENCODED.values()))
    return payload[: rng.randrange(len(payload))] + other[rng.randrange(len(other)) :]


def _swap_a_value(rng: random.Random, payload: bytes) -> bytes:
    fields = msgspec.msgpack.decode(payload)
    place = fields
    while True:
        key = rng.choice(list(place) if isinstance(place, dict) else range(len(place)))
        if isinstance(place[key], dict | list) and place[key] and rng.random() < 0.8:
            place = place[key]
            continue
        place[key] = rng.choice(ODD_VALUES)
        return msgspec.msgpack.encode(fields)


def _drop_or_double_a_field(rng: random.Random, payload: bytes) -> bytes:
    fields = msgspec.msgpack.decode(payload)
    del fields[rng.choice(list(fields))]
    return msgspec.msgpack.encode({**fields, rng.choice(["x", "v", "z"]): rng.choice(ODD_VALUES)})


def _wrong_version(rng: random.Random, payload: bytes) -> bytes:
    version = rng.choice([0, 2, -1, 2**40, 2**64 - 1, 1.0, "1", None, True])
    return msgspec.msgpack.encode({**msgspec.msgpack.decode(payload), "v": version})


def _nest(rng: random.Random, payload: bytes) -> bytes:
    fields = msgspec.msgpack.decode(payload)
    key = rng.choice(list(fields)).encode()
    depth = rng.choice([10, 1000, 60000])
    opening = rng.choice([b"\x91", b"\x81\xa1v", b"\xdd\xff\xff\xff\xff", b"\xdf\x00\x00\x00\x01"])
    head = b"\x82\xa1v\x01" + bytes([0xA0 | len(key)]) + key
    return head + (opening * depth)[: MAX_BYTES - 100]


def _noise(rng: random.Random, payload: bytes) -> bytes:
    return rng.randbytes(rng.randrange(2 * len(payload)))


def _blow_up(rng: random.Random, payload: bytes) -> bytes:
    return payload + rng.randbytes(rng.choice([1, 100])) * rng.choice([1, 100, 10000])


MUTATIONS: list[Callable[[random.Random, bytes], bytes]] = [
    _flip_bits, _flip_bits, _truncate, _splice, _swap_a_value, _swap_a_value,
    _drop_or_double_a_field, _wrong_version, _nest, _noise, _blow_up,
]  # fmt: skip


def _refusal(message_type: type[Message], payload: bytes) -> str | None:
    """The reason, or None for a valid record that encodes to itself again."""
    try:
        message = decode(message_type, payload)
    except RecordRefused as refusal:
        return refusal.reason
    assert isinstance(message, message_type)
    again = encode(message)
    assert encode(decode(message_type, again)) == again
    return None


@pytest.mark.parametrize("name", EXAMPLES)
def test_mutated_messages(name: str) -> None:
    rng = random.Random(f"mutations of {name}")
    message_type = type(EXAMPLES[name])
    refusals = []
    for _ in range(PER_EXAMPLE):
        payload = rng.choice(MUTATIONS)(rng, ENCODED[name])
        refusals.append(_refusal(message_type, payload))
        address_of(payload)
    assert "" not in refusals
    assert refusals.count(None) < PER_EXAMPLE / 2


def test_the_corpus_is_large_enough() -> None:
    assert PER_EXAMPLE * len(EXAMPLES) >= 10_000
