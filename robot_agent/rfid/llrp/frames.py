"""A stream of bytes cut into LLRP messages, before anything in them is believed."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

HEADER = struct.Struct(">HII")
"""Version and type, length with this header, message id (LLRP 1.0.1, 9.1)."""
VERSIONS = (1, 2)
LARGEST_BYTES = 256 * 1024
"""Hundreds of times a report of everything in range; more is not a message."""


class FramingError(Exception):
    """The stream is not LLRP, or not any more: where the next message begins is unknown."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One message as it travels, header included."""

    kind: int
    id: int
    content: bytes


@dataclass(slots=True)
class Splitter:
    _waiting: bytearray = field(default_factory=bytearray)

    def feed(self, received: bytes) -> Iterator[Frame]:
        """The messages that are complete now. Raises FramingError; the stream is lost then."""
        self._waiting += received
        while len(self._waiting) >= HEADER.size:
            first, length, id = HEADER.unpack_from(self._waiting)
            version, kind = first >> 10, first & 0x3FF
            if version not in VERSIONS:
                raise FramingError(f"version {version} of LLRP, expected 1 or 2")
            if not HEADER.size <= length <= LARGEST_BYTES:
                raise FramingError(f"a message of {length} bytes, expected at most {LARGEST_BYTES}")
            if len(self._waiting) < length:
                return
            content = bytes(self._waiting[:length])
            del self._waiting[:length]
            yield Frame(kind, id, content)
