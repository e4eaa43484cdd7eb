"""Frames of camera servers: what goes in comes out, and no bytes do harm."""

import struct
from itertools import chain

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_agent.cameras.camera import Failure, Size, StereoPair
from robot_agent.cameras.frames import (
    ANSWER_BYTES,
    MOST_BYTES,
    MOST_TEXT_BYTES,
    QUESTION_BYTES,
    REASONS,
    BadFrame,
    Header,
    Kind,
    Question,
    answer_to,
    decode_header,
    decode_question,
)

U32, TIME = st.integers(0, 2**32 - 1), st.integers(0, 2**63 - 1)
SIZE = st.tuples(st.integers(0, 4096), st.integers(0, 4096))
TEXT = st.integers(0, MOST_TEXT_BYTES)
SKEW = st.none() | st.integers(-(2**63) + 1, 2**63 - 1)
HEADERS = st.one_of(
    st.builds(
        Header, st.just(Kind.PAIR), U32, TIME, SKEW, SIZE, SIZE, st.sampled_from([8, 16]),
        text_bytes=TEXT,
    ),
    st.builds(Header, st.just(Kind.NOTHING_NEW), U32),
    st.builds(Header, st.just(Kind.FAILURE), U32, reason=st.sampled_from(REASONS), text_bytes=TEXT),
)  # fmt: skip


@given(U32, st.none() | TIME, U32)
def test_a_question_is_understood(number: int, after_ns: int | None, wait_ms: int):
    question = Question(number, after_ns, wait_ms)
    assert decode_question(question.encode()) == question


@given(HEADERS)
def test_an_answer_is_understood(header: Header):
    assert decode_header(header.encode()) == header


def test_the_bytes_stay_what_they_are():
    question = "5443 01 01 00000007 0000000000000064 000003e8"
    assert Question(7, 100, 1000).encode() == bytes.fromhex(question)
    assert Question(7, None, 0).encode()[8:16] == b"\xff" * 8
    left = np.array([[1, 0x203, 5]], np.uint16)
    right = np.array([[7, 9]], np.uint16)
    pair = StereoPair(left, right, 100, None, "é")
    sent = b"".join(map(bytes, answer_to(7, pair)))
    assert sent == bytes.fromhex(
        "5443 01 81 00000007 0000000000000064 8000000000000000 0003 0001 0002 0001 10 00 0002"
        "0100 0302 0500 0700 0900 c3a9"
    )
    [header, text] = answer_to(8, Failure("ended", "over"))
    assert bytes(header)[3:8] == bytes.fromhex("83 00000008")
    assert (bytes(header)[33], bytes(text)) == (6, b"over")


def test_pixels_of_views_are_sent_in_their_order():
    left = np.arange(64, dtype=np.uint8).reshape(8, 8)
    pieces = answer_to(1, StereoPair(left[::2, 1:3], left.T, 1, None, ""))
    assert bytes(pieces[1]) == left[::2, 1:3].tobytes()
    assert bytes(pieces[2]) == left.T.tobytes()


@given(st.binary(max_size=64))
def test_no_bytes_do_harm(data: bytes):
    for decode in (decode_question, decode_header):
        with pytest.raises(BadFrame):
            decode(data)


@settings(max_examples=300)
@given(st.sampled_from(list(Kind)), st.binary(min_size=ANSWER_BYTES - 4, max_size=ANSWER_BYTES - 4))
def test_nor_do_those_that_begin_like_an_answer(kind: Kind, rest: bytes):
    try:
        header = decode_header(b"TC\x01" + bytes([kind]) + rest)
    except BadFrame:
        return
    assert 0 <= sum(header.side_bytes) <= MOST_BYTES
    assert header.text_bytes <= MOST_TEXT_BYTES


@given(st.integers(0, 65535), st.integers(0, 65535), st.integers(0, 255))
def test_nothing_announces_more_than_is_allowed(width: int, height: int, bits: int):
    size: Size = (width, height)
    sent = struct.pack(">2sBBIqqHHHHBBH", b"TC", 1, 129, 1, 1, 0, *chain(size, size), bits, 0, 0)
    is_allowed = bits in (8, 16) and 2 * width * height * bits // 8 <= MOST_BYTES
    if is_allowed:
        assert decode_header(sent).left_px == size
    else:
        with pytest.raises(BadFrame) as refused:
            decode_header(sent)
        assert refused.value.reason == "bad_image"


def test_lengths_are_those_of_the_page():
    assert (QUESTION_BYTES, ANSWER_BYTES) == (20, 36)
