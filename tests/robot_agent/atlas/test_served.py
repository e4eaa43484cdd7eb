"""The list of tags as it comes over the wire: nothing but RecordRefused is raised."""

from contextlib import suppress

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_agent.atlas import served
from robot_agent.atlas.served import tags_of
from tagmap.errors import RecordRefused
from tagmap.records import Tag

TAG = Tag(
    tag="a",
    p_m=(1.0, 2.0, 3.0),
    cov=(1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4),
    state="mapped",
    n=3,
    version=1,
    gauge="anchored",
)


def test_a_list_of_tags():
    assert tags_of(msgspec.msgpack.encode([TAG, TAG])) == (TAG, TAG)
    assert tags_of(msgspec.msgpack.encode([])) == ()


@pytest.mark.parametrize(
    ("payload", "why"),
    [
        (b"\x91\x81\xa3tag\xa2\xff\xfe", "invalid"),
        (b"\x91" * 5000, "invalid"),
        (b"", "invalid"),
        (msgspec.msgpack.encode([msgspec.structs.replace(TAG, v=2)]), "tag a: schema version 2"),
    ],
)
def test_what_is_none_is_refused(payload, why):
    with pytest.raises(RecordRefused, match=why):
        tags_of(payload)


def test_what_is_too_large_is_refused_before_it_is_read(monkeypatch):
    monkeypatch.setattr(served, "MOST_BYTES", 100)
    with pytest.raises(RecordRefused, match="at most 100"):
        tags_of(msgspec.msgpack.encode([TAG] * 9))


@given(st.binary(max_size=200))
def test_any_bytes_may_arrive(payload):
    with suppress(RecordRefused):
        tags_of(payload)
