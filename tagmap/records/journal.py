"""Observation journal: one robot's measurements in a file, the way a source recorded them.

A journal is a sequence of frames, each a 4-byte big-endian length and that many bytes of msgpack:
first one Introduction, then Observations in time order.
"""

import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from tagmap.errors import DataError, RecordRefused
from tagmap.records.codec import MAX_BYTES, decode, encode
from tagmap.records.hello import Introduction
from tagmap.records.keyframe import Observation

MAGIC = b"tagmap-journal-1\n"
_LENGTH = struct.Struct(">I")


def write_journal(
    path: Path, introduction: Introduction, observations: Iterable[Observation]
) -> int:
    """Write a journal and return its number of observations."""
    count = 0
    with path.open("wb") as file:
        file.write(MAGIC)
        _write_frame(file, encode(introduction))
        for observation in observations:
            _write_frame(file, encode(observation))
            count += 1
    return count


def read_introduction(path: Path) -> Introduction:
    with _open(path) as file:
        return _introduction(path, file)


def read_observations(path: Path, skip: int = 0) -> Iterator[Observation]:
    """Observations after the first `skip`. DataError names file and index."""
    with _open(path) as file:
        _introduction(path, file)
        index = 0
        while (payload := _read_frame(path, file, f"observation {index}")) is not None:
            if index >= skip:
                try:
                    yield decode(Observation, payload)
                except RecordRefused as error:
                    raise DataError(f"{path}: observation {index}: {error}") from None
            index += 1


def _open(path: Path) -> BinaryIO:
    try:
        file = path.open("rb")
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    if file.read(len(MAGIC)) != MAGIC:
        file.close()
        raise DataError(f"{path}: not an observation journal")
    return file


def _introduction(path: Path, file: BinaryIO) -> Introduction:
    payload = _read_frame(path, file, "introduction")
    if payload is None:
        raise DataError(f"{path}: ends before the introduction")
    try:
        return decode(Introduction, payload)
    except RecordRefused as error:
        raise DataError(f"{path}: introduction: {error}") from None


def _write_frame(file: BinaryIO, payload: bytes) -> None:
    file.write(_LENGTH.pack(len(payload)))
    file.write(payload)


def _read_frame(path: Path, file: BinaryIO, what: str) -> bytes | None:
    head = file.read(_LENGTH.size)
    if not head:
        return None
    size = _LENGTH.unpack(head)[0] if len(head) == _LENGTH.size else 0
    if size > MAX_BYTES:
        raise DataError(f"{path}: {what} claims {size} bytes, at most {MAX_BYTES}")
    payload = file.read(size) if size else b""
    if not size or len(payload) != size:
        raise DataError(f"{path}: {what} is cut short")
    return payload
