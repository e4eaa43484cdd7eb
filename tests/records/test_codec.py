"""What is decoded is what was encoded; what is not acceptable is refused with a reason."""

import math
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tagmap.errors import RecordRefused
from tagmap.records import Keyframe, Observation, address_of, decode, encode
from tagmap.records.base import Message
from tagmap.records.codec import MAX_BYTES
from tagmap.records.schema import MESSAGES as ALL
from tests.records.examples import EXAMPLES
from tests.records.strategies import MESSAGES


def test_there_is_a_strategy_for_every_message() -> None:
    assert set(MESSAGES) == set(ALL)


@pytest.mark.parametrize("message_type", MESSAGES, ids=lambda message: message.__name__)
@settings(max_examples=40)
@given(data=st.data())
def test_round_trip(message_type: type[Message], data: st.DataObject) -> None:
    message = data.draw(MESSAGES[message_type])
    assert decode(message_type, encode(message)) == message


KEYFRAME = msgspec.msgpack.decode(encode(EXAMPLES["keyframe"]))
PLANAR = msgspec.msgpack.decode(encode(EXAMPLES["keyframe_planar"]))


def _refused(fields: dict[str, Any]) -> str:
    with pytest.raises(RecordRefused) as caught:
        decode(Keyframe, msgspec.msgpack.encode(fields))
    return caught.value.reason


def _with_z(z: dict[str, Any]) -> dict[str, Any]:
    return {**KEYFRAME, "sightings": [{**KEYFRAME["sightings"][0], "z": z}]}


@pytest.mark.parametrize(
    ("fields", "word"),
    [
        ({**KEYFRAME, "v": 2}, "version 2"),
        ({**KEYFRAME, "v": "1"}, "v"),
        ({k: v for k, v in KEYFRAME.items() if k != "v"}, "v"),
        ({**KEYFRAME, "seq": 0}, "seq"),
        ({**KEYFRAME, "seq": 2**53 + 1}, "seq"),
        ({**KEYFRAME, "robot": "R1"}, "robot"),
        ({**KEYFRAME, "robot": "r1\n"}, "robot"),
        ({**KEYFRAME, "session": "short"}, "session"),
        ({**KEYFRAME, "t_ns": -1}, "t_ns"),
        ({**KEYFRAME, "t_ns": 2**63}, "t_ns"),
        ({**KEYFRAME, "T_base_cam": PLANAR["T_base_cam"]}, "planar"),
        ({**KEYFRAME, "sightings": KEYFRAME["sightings"] * 65}, "sightings"),
        ({**PLANAR, "sightings": KEYFRAME["sightings"][:1]}, "stereo_px"),
        ({**KEYFRAME, "sightings": PLANAR["sightings"][:1]}, "point_cam_m"),
        (_with_z({"mono_px": [1.0, math.nan], "cov": [1.0, 0.0, 1.0]}), "mono_px"),
        (_with_z({"mono_px": [1.0, math.inf], "cov": [1.0, 0.0, 1.0]}), "mono_px"),
        (_with_z({"mono_px": [1.0, 1e300], "cov": [1.0, 0.0, 1.0]}), "mono_px"),
        (_with_z({"mono_px": [1.0, 2.0], "cov": [1.0, 2.0, 1.0]}), "positive definite"),
        (_with_z({"mono_px": [1.0, 2.0], "cov": [0.0, 0.0, 0.0]}), "positive definite"),
        (_with_z({"mono_px": [1.0, 2.0], "cov": [1.0, 0.0]}), "cov"),
        (_with_z({"range_m": 1.0, "cov": [1.0, 0.0, 1.0]}), "come together"),
        (_with_z({"range_m": -1.0, "bearing_rad": 0.0, "cov": [1.0, 0.0, 1.0]}), "range_m"),
        (_with_z({"cov": [1.0, 0.0, 1.0]}), "exactly one"),
        ({**KEYFRAME, "T_base_cam": {"p_m": [0.0] * 3, "q_wxyz": [1.0, 1.0, 0.0, 0.0]}}, "norm"),
        ({**KEYFRAME, "T_base_cam": {"p_m": [0.0] * 3}}, "either"),
    ],
)
def test_refusals_say_what_is_wrong(fields: dict[str, Any], word: str) -> None:
    assert word in _refused(fields)


@pytest.mark.parametrize("payload", [b"", b"\xc1", b"\x80", b"\xff" * 100, b"{}", b"\x81\xa1v"])
def test_bytes_that_are_no_message(payload: bytes) -> None:
    with pytest.raises(RecordRefused, match="malformed"):
        decode(Observation, payload)


def test_too_large_is_refused_before_it_is_read() -> None:
    with pytest.raises(RecordRefused, match=f"at most {MAX_BYTES}"):
        decode(Observation, b"\x81" * (MAX_BYTES + 1))


def test_the_address_of_a_refused_keyframe_is_still_read() -> None:
    payload = msgspec.msgpack.encode({**KEYFRAME, "T_base_cam": None})
    address = address_of(payload)
    assert address is not None
    assert (address.session, address.seq) == (KEYFRAME["session"], 12)
    assert address_of(b"\xc1") is None
    assert address_of(encode(EXAMPLES["lease_request"])) is None
