"""Questions to a camera server and its answers, over TCP; docs/cameras.md has them byte by byte.
Numbers are big-endian; pixels of 16 bits are little-endian, as they lie in memory."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, get_args

import numpy as np

from robot_agent.cameras.camera import Failure, Reason, Size, StereoPair, shown_size, size_of
from robot_agent.perception.spots import Image

MAGIC, VERSION = b"TC", 1
ANY_TIME = -1
UNKNOWN_SKEW = -(2**63)
MOST_BYTES = 1 << 28
"""Of the pixels of a pair."""
MOST_TEXT_BYTES = 1024
REASONS: tuple[Reason, ...] = get_args(Reason)
DTYPES: dict[int, np.dtype[Any]] = {8: np.dtype("u1"), 16: np.dtype("<u2")}

_QUESTION = struct.Struct(">2sBBIqI")
_ANSWER = struct.Struct(">2sBBIqqHHHHBBH")
QUESTION_BYTES, ANSWER_BYTES = _QUESTION.size, _ANSWER.size


class Kind(IntEnum):
    ASK = 1
    PAIR = 129
    NOTHING_NEW = 130
    FAILURE = 131


class BadFrame(ValueError):
    """Not one of ours, or of a pair that nobody can have. `reason` as in camera.Failure."""

    def __init__(self, reason: Reason, why: str) -> None:
        super().__init__(why)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Question:
    """The newest pair after `after_ns`, any if None; it may be waited for as long as `wait_ms`."""

    number: int
    after_ns: int | None
    wait_ms: int

    def encode(self) -> bytes:
        after_ns = ANY_TIME if self.after_ns is None else self.after_ns
        return _QUESTION.pack(MAGIC, VERSION, Kind.ASK, self.number, after_ns, self.wait_ms)


@dataclass(frozen=True, slots=True)
class Header:
    """What comes before the pixels of left and right, row by row, and a text in UTF-8: the name of
    the pair, or the detail of a failure."""

    kind: Kind
    number: int
    t_ns: int = 0
    skew_ns: int | None = None
    left_px: Size = (0, 0)
    right_px: Size = (0, 0)
    bits: int = 0
    reason: Reason | None = None
    text_bytes: int = 0

    @property
    def side_bytes(self) -> tuple[int, int]:
        """Of the pixels of each side."""
        (left_w, left_h), (right_w, right_h) = self.left_px, self.right_px
        return left_w * left_h * self.bits // 8, right_w * right_h * self.bits // 8

    def encode(self) -> bytes:
        skew_ns = UNKNOWN_SKEW if self.skew_ns is None else self.skew_ns
        reason = 0 if self.reason is None else 1 + REASONS.index(self.reason)
        return _ANSWER.pack(
            MAGIC,
            VERSION,
            self.kind,
            self.number,
            self.t_ns,
            skew_ns,
            *self.left_px,
            *self.right_px,
            self.bits,
            reason,
            self.text_bytes,
        )


def decode_question(data: bytes) -> Question:
    """Raise BadFrame, and nothing else, for what is none."""
    if len(data) != QUESTION_BYTES:
        raise BadFrame("camera_gone", f"{len(data)} bytes, expected {QUESTION_BYTES}")
    magic, version, kind, number, after_ns, wait_ms = _QUESTION.unpack(data)
    if (magic, version, kind) != (MAGIC, VERSION, Kind.ASK):
        raise BadFrame("camera_gone", f"begins with {data[:4]!r}, expected a question")
    return Question(number, None if after_ns < 0 else after_ns, wait_ms)


def decode_header(data: bytes) -> Header:
    """Raise BadFrame, and nothing else, for what is none."""
    if len(data) != ANSWER_BYTES:
        raise BadFrame("camera_gone", f"{len(data)} bytes, expected {ANSWER_BYTES}")
    magic, version, kind, number, t_ns, skew_ns, *sizes, bits, reason, text_bytes = _ANSWER.unpack(
        data
    )
    if (magic, version) != (MAGIC, VERSION) or kind not in tuple(Kind) or kind == Kind.ASK:
        raise BadFrame("camera_gone", f"begins with {data[:4]!r}, which is no camera server")
    if text_bytes > MOST_TEXT_BYTES:
        raise BadFrame("camera_gone", f"announces {text_bytes} bytes of text")
    if kind == Kind.PAIR:
        skew = None if skew_ns == UNKNOWN_SKEW else skew_ns
        left_px, right_px = (sizes[0], sizes[1]), (sizes[2], sizes[3])
        size = (left_px, right_px, bits)
        return _checked(Header(Kind.PAIR, number, t_ns, skew, *size, text_bytes=text_bytes))
    if kind == Kind.NOTHING_NEW:
        return Header(Kind.NOTHING_NEW, number, text_bytes=text_bytes)
    if not 1 <= reason <= len(REASONS):
        raise BadFrame("camera_gone", f"fails for reason {reason}, expected 1 to {len(REASONS)}")
    return Header(Kind.FAILURE, number, reason=REASONS[reason - 1], text_bytes=text_bytes)


def _checked(header: Header) -> Header:
    if header.bits not in DTYPES:
        raise BadFrame("bad_image", f"announces pixels of {header.bits} bits, expected 8 or 16")
    if header.t_ns < 0:
        raise BadFrame("bad_image", f"announces the time {header.t_ns} ns")
    if sum(header.side_bytes) > MOST_BYTES:
        sizes = f"{shown_size(header.left_px)} and {shown_size(header.right_px)}"
        raise BadFrame("bad_image", f"announces {sizes}: more than {MOST_BYTES >> 20} MiB")
    return header


def answer_to(number: int, found: StereoPair | Failure | None) -> list[bytes | memoryview]:
    """What a server sends, piece by piece; pixels are not copied where rows lie side by side."""
    if found is None:
        return [Header(Kind.NOTHING_NEW, number).encode()]
    if isinstance(found, Failure):
        text = _text(found.detail)
        header = Header(Kind.FAILURE, number, reason=found.reason, text_bytes=len(text))
        return [header.encode(), text]
    text, bits = _text(found.name), 8 * found.left.dtype.itemsize
    sizes = size_of(found.left), size_of(found.right)
    header = Header(
        Kind.PAIR, number, found.t_ns, found.skew_ns, *sizes, bits, text_bytes=len(text)
    )
    return [header.encode(), _pixels(found.left), _pixels(found.right), text]


def _text(text: str) -> bytes:
    return text.encode(errors="replace")[:MOST_TEXT_BYTES]


def _pixels(image: Image) -> memoryview:
    in_order = np.ascontiguousarray(image, DTYPES[8 * image.dtype.itemsize])
    data: memoryview = in_order.reshape(-1).view(np.uint8).data
    return data
