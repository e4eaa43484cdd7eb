"""Bytes that have once been on the wire are understood for ever."""

from pathlib import Path

import msgspec
import pytest

from tagmap.records import decode, encode
from tagmap.records.base import Message
from tagmap.records.schema import MESSAGES
from tests.records.examples import EXAMPLES

GOLDEN = Path(__file__).parent / "golden" / "v1"


@pytest.mark.parametrize("name", EXAMPLES)
def test_golden_bytes_both_ways(name: str) -> None:
    message = EXAMPLES[name]
    golden = bytes.fromhex((GOLDEN / f"{name}.hex").read_text())
    assert decode(type(message), golden) == message
    assert encode(message) == golden


@pytest.mark.parametrize("path", sorted((GOLDEN / "older").glob("*.hex")), ids=lambda p: p.stem)
def test_bytes_of_older_writers_have_the_same_meaning(path: Path) -> None:
    """Written before messages had all the fields of today."""
    message = EXAMPLES[path.stem.partition(".")[0]]
    assert decode(type(message), bytes.fromhex(path.read_text())) == message


def test_every_message_has_an_example_and_every_golden_file_is_used() -> None:
    assert {type(message) for message in EXAMPLES.values()} == set(MESSAGES)
    assert {path.stem for path in GOLDEN.glob("*.hex")} == set(EXAMPLES)


@pytest.mark.parametrize("message", EXAMPLES.values(), ids=EXAMPLES)
def test_fields_of_newer_writers_are_ignored(message: Message) -> None:
    fields = msgspec.msgpack.decode(encode(message))
    payload = msgspec.msgpack.encode({"later": [1, {"x": None}], **fields})
    assert decode(type(message), payload) == message
