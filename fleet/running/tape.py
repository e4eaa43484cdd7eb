"""What went over the wire of a run, and when: recorded as it is heard, judged afterwards.

A frame is a time (8 bytes), the length of the key (2) and of the payload (4), big-endian, and both.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from tagmap.errors import DataError

_HEAD = struct.Struct(">QHI")


@dataclass(frozen=True, slots=True)
class Heard:
    """A put: `t_ns` is the time of the world, when it left its sender as far as that is known."""

    t_ns: int
    key: str
    payload: bytes


class Tape:
    """`with Tape(path) as tape: tape.hear(...)`"""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")

    def hear(self, t_ns: int, key: str, payload: bytes) -> None:
        name = key.encode()
        self._file.write(_HEAD.pack(t_ns, len(name), len(payload)) + name + payload)

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def read_tape(path: Path) -> Iterator[Heard]:
    """In the order in which it was heard; a last frame that is cut short is left out. Raises
    DataError."""
    try:
        with path.open("rb") as file:
            while len(head := file.read(_HEAD.size)) == _HEAD.size:
                t_ns, key_bytes, payload_bytes = _HEAD.unpack(head)
                body = file.read(key_bytes + payload_bytes)
                if len(body) < key_bytes + payload_bytes:
                    return
                yield Heard(t_ns, body[:key_bytes].decode(), body[key_bytes:])
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None
