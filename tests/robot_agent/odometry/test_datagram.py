"""Datagrams: what goes in comes out, the bytes are those of the page, and no bytes do harm."""

import math
import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_agent.odometry.datagram import BYTES, LARGEST, BadDatagram, Datagram, Reckoned, decode

NUMBER = st.integers(0, 2**32 - 1)
VALUE = st.floats(-LARGEST, LARGEST)
RECKONED = st.builds(Reckoned, st.integers(0, 2**63 - 1), VALUE, VALUE, VALUE)
GOLDEN = bytes.fromhex(
    "544f0100 00000007 00000009 0000000000000064 3ff8000000000000 c000000000000000"
    " 401921fb54442d18 fa486e41"
)


def signed(content: bytes) -> bytes:
    return content + zlib.crc32(content).to_bytes(4)


@given(NUMBER, NUMBER, RECKONED)
def test_what_is_sent_is_read(epoch: int, number: int, reckoned: Reckoned):
    datagram = Datagram(epoch, number, reckoned)
    assert decode(datagram.encode()) == datagram


def test_the_bytes_stay_what_they_are():
    datagram = Datagram(7, 9, Reckoned(100, 1.5, -2.0, 2 * math.pi))
    assert datagram.encode() == GOLDEN
    assert decode(GOLDEN) == datagram


@given(st.binary(max_size=2 * BYTES) | st.binary(min_size=BYTES, max_size=BYTES))
def test_no_bytes_do_harm(data: bytes):
    with pytest.raises(BadDatagram):
        decode(data)


@settings(max_examples=300)
@given(st.binary(min_size=BYTES - 8, max_size=BYTES - 8))
def test_nor_do_those_with_a_checksum_that_is_right(data: bytes):
    try:
        datagram = decode(signed(GOLDEN[:4] + data))
    except BadDatagram:
        return
    reckoned = datagram.reckoned
    assert reckoned.t_ns >= 0
    assert all(abs(v) <= LARGEST for v in (reckoned.x_m, reckoned.y_m, reckoned.theta_rad))


@given(st.integers(0, 8 * BYTES - 1))
def test_one_bit_that_changed_is_noticed(bit: int):
    spoilt = bytearray(GOLDEN)
    spoilt[bit // 8] ^= 1 << bit % 8
    with pytest.raises(BadDatagram):
        decode(bytes(spoilt))


@pytest.mark.parametrize(
    ("reckoned", "said"),
    [
        (Reckoned(-1, 0.0, 0.0, 0.0), "the time is -1 ns"),
        (Reckoned(0, math.nan, 0.0, 0.0), "x is nan"),
        (Reckoned(0, 0.0, -math.inf, 0.0), "y is -inf"),
        (Reckoned(0, 0.0, 0.0, 2e6), "theta is 2000000.0"),
    ],
)
def test_what_was_not_driven_is_none(reckoned: Reckoned, said: str):
    with pytest.raises(BadDatagram, match=said):
        decode(Datagram(1, 1, reckoned).encode())


@pytest.mark.parametrize(
    ("at", "byte", "said"), [(0, 0, "begins with"), (2, 2, "begins with"), (3, 1, "begins with")]
)
def test_another_version_is_refused(at: int, byte: int, said: str):
    content = bytearray(GOLDEN[:-4])
    content[at] = byte
    with pytest.raises(BadDatagram, match=said):
        decode(signed(bytes(content)))
