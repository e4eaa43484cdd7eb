"""Datagrams to a laser with two mirrors, and its answers: 28 bytes each, big-endian.

     0  2 bytes  "TL"
     2  u8       version, 1
     3  u8       operation: 1 open, 2 status, 3 steer, 4 light, 5 dark; in an answer + 128
     4  u32      session, chosen by the commander with "open"
     8  u32      number of the command, ascending within a session
    12  u64      light: dark at this time of the device's clock, in us; in an answer: its time now
    20  u16 u16  steer: steps of mirrors X, Y; in an answer: where they are
    24  u8       in an answer: 1 while the laser is on
    25  u8       in an answer: 0 done, else why not: see Refusal
    26  2 bytes  zero

The device obeys the session that opened last, and of that only commands with a higher number than
all before: what is doubled or overtaken on the way does nothing. `light` names a time of the
device's own clock, so an order that comes late is over before it begins.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

MAGIC, VERSION = b"TL", 1
ANSWER = 128
LONGEST_US = 1_000_000
"""A device refuses to be lit for longer."""
_FORM = struct.Struct(">2sBBIIQHHBB2x")
BYTES = _FORM.size


class Op(IntEnum):
    OPEN = 1
    STATUS = 2
    STEER = 3
    LIGHT = 4
    DARK = 5


class Refusal(IntEnum):
    DONE = 0
    ANOTHER_SESSION = 1
    OLD_NUMBER = 2
    OUT_OF_RANGE = 3
    TOO_LATE = 4
    TOO_LONG = 5
    FAULT = 6


class BadDatagram(ValueError):
    """Not one of ours; says why."""


@dataclass(frozen=True, slots=True)
class Datagram:
    op: Op
    session: int
    number: int
    time_us: int = 0
    steps: tuple[int, int] = (0, 0)
    lit: bool = False
    refusal: Refusal = Refusal.DONE
    answer: bool = False

    def encode(self) -> bytes:
        op = self.op + (ANSWER if self.answer else 0)
        return _FORM.pack(
            MAGIC,
            VERSION,
            op,
            self.session,
            self.number,
            self.time_us,
            *self.steps,
            self.lit,
            self.refusal,
        )


def decode(data: bytes) -> Datagram:
    """Raise BadDatagram, and nothing else, for what is none."""
    if len(data) != BYTES:
        raise BadDatagram(f"{len(data)} bytes, expected {BYTES}")
    magic, version, op, session, number, time_us, x, y, lit, refusal = _FORM.unpack(data)
    if magic != MAGIC or version != VERSION:
        raise BadDatagram(f"begins with {magic!r} {version}, expected {MAGIC!r} {VERSION}")
    try:
        return Datagram(
            Op(op & ~ANSWER),
            session,
            number,
            time_us,
            (x, y),
            bool(lit),
            Refusal(refusal),
            bool(op & ANSWER),
        )
    except ValueError as error:
        raise BadDatagram(str(error)) from None
