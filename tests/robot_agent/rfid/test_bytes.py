"""Whatever a socket delivers: messages, or one of two errors, and nothing else."""

import struct
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_agent.rfid.llrp import codec, outcome, reports, requests
from robot_agent.rfid.llrp.codec import LlrpUnavailable, Undecodable, decode, encode, llrp, name_of
from robot_agent.rfid.llrp.frames import HEADER, LARGEST_BYTES, Frame, FramingError, Splitter

EPC = "e20047000000000000000001"


def frame(content: bytes) -> Frame:
    [whole] = Splitter().feed(content)
    return whole


def report() -> bytes:
    """A report as a reader sends it: one tag seen, one that was written and read."""
    p = llrp()
    seen = [
        p.EPC_96_Parameter(int(EPC, 16)),
        p.ROSpecID_Parameter(7),
        p.FirstSeenTimestampUptime_Parameter(2_000_000),
        p.LastSeenTimestampUptime_Parameter(3_000_000),
        p.TagSeenCount_Parameter(4),
    ]
    results = [
        p.C1G2WriteOpSpecResult_Parameter(OpSpecID=1, NumWordsWritten=2),
        p.C1G2ReadOpSpecResult_Parameter(OpSpecID=2, ReadData=[5, 6]),
    ]
    data = [p.TagReportData_Parameter(Parameters=more) for more in (seen, [*seen, *results])]
    return encode(p.RO_ACCESS_REPORT_Message(Parameters=data))


GENUINE = [
    report(),
    *(
        encode(message)
        for message in (
            requests.configure(1.0),
            *requests.open_window(7, 0.1, [0]),
            *requests.prepare_access(7, 7, EPC, [requests.write_command(0, [1, 2])]),
            requests.ask_capabilities(),
        )
    ),
]


@st.composite
def spoiled(draw: st.DrawFn) -> bytes:
    """A genuine message with some of its inside replaced; the header stays."""
    content = bytearray(draw(st.sampled_from(GENUINE)))
    for _ in range(draw(st.integers(0, 5))):
        at = draw(st.integers(HEADER.size, len(content) - 1))
        content[at : at + 4] = draw(st.binary(min_size=0, max_size=8))
        content += b"\0" * (HEADER.size + 1 - len(content))
    content[2:6] = struct.pack(">I", len(content))
    return bytes(content)


@given(st.lists(st.binary(max_size=40)))
def test_a_stream_is_cut_or_refused(chunks: list[bytes]):
    splitter = Splitter()
    try:
        found = [whole for chunk in chunks for whole in splitter.feed(chunk)]
    except FramingError:
        return
    assert b"".join(chunks).startswith(b"".join(whole.content for whole in found))


@given(st.lists(st.sampled_from(GENUINE), max_size=5), st.integers(1, 60))
def test_messages_survive_any_cutting(sent: list[bytes], size: int):
    stream, splitter = b"".join(sent), Splitter()
    chunks = (stream[i : i + size] for i in range(0, len(stream), size))
    assert [whole.content for chunk in chunks for whole in splitter.feed(chunk)] == sent


@pytest.mark.parametrize(
    ("first", "length", "said"),
    [
        (0x0400, LARGEST_BYTES + 1, "a message of 262145 bytes, expected at most 262144"),
        (0x0400, 9, "a message of 9 bytes"),
        (0x0000, 10, "version 0 of LLRP, expected 1 or 2"),
        (0x2400, 10, "version 9 of LLRP"),
    ],
)
def test_what_is_no_header_is_refused(first: int, length: int, said: str):
    with pytest.raises(FramingError, match=said):
        list(Splitter().feed(HEADER.pack(first, length, 1)))


@settings(max_examples=300, deadline=None)
@given(spoiled())
def test_any_inside_is_a_message_or_undecodable(content: bytes):
    """And what is a message is read without an error, whatever it says."""
    try:
        message = decode(frame(content))
    except Undecodable:
        return
    facts = reports.facts(message, 7)
    reports.connection_status(message)
    reports.refusal(message)
    outcome.reader_info("here", message)
    outcome.inventory(facts, 0, 1)
    outcome.read(facts, EPC, 0, 2, 0.1)
    outcome.written(facts, EPC, 0, (5, 6), 0.1)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 1023), st.binary(max_size=200))
def test_any_bytes_of_any_type(kind: int, inside: bytes):
    header = HEADER.pack(0x0400 | kind, HEADER.size + len(inside), 1)
    try:
        name_of(decode(frame(header + inside)))
    except Undecodable:
        return


def test_a_deep_nest_is_undecodable():
    """Parameters in parameters beyond what the stack holds."""
    depth = 12_000
    nest = b"".join(struct.pack(">HH", 246, 4 * (depth - i)) for i in range(depth))
    content = HEADER.pack(0x0400 | 63, HEADER.size + len(nest), 1) + nest
    with pytest.raises(Undecodable):
        decode(frame(content))


def test_fields_of_bits_are_numbers():
    sent = requests.prepare_access(1, 1, EPC, [requests.read_command(0, 0)])[0]
    back = decode(frame(encode(sent)))
    assert encode(back) == encode(sent)


@pytest.mark.parametrize("missing", ["pyllrp", "bitstring"])
def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch, missing: str):
    monkeypatch.setitem(sys.modules, missing, None)
    codec.llrp.cache_clear()
    with pytest.raises(LlrpUnavailable, match=r"pip install tagmap\[llrp\]"):
        llrp()
    codec.llrp.cache_clear()


def test_a_bitstring_that_is_too_new_is_named(monkeypatch: pytest.MonkeyPatch):
    import bitstring

    monkeypatch.delattr(bitstring, "BitStream")
    monkeypatch.setattr(bitstring, "__version__", "5.0.1")
    codec.llrp.cache_clear()
    with pytest.raises(LlrpUnavailable, match=r"bitstring < 5, found 5\.0\.1"):
        llrp()
    codec.llrp.cache_clear()
