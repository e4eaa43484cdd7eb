"""The service's map as the robot keeps it, also over a restart without the service."""

from pathlib import Path

import msgspec

from tagmap.errors import DataError, RecordRefused
from tagmap.records import MapVersion, Tag, decode, encode
from tagmap.records.base import VERSION, Message
from tagmap.records.replacing import replace_file

MOST_BYTES = 1 << 26


class ServedMap(Message, frozen=True, kw_only=True):
    """A version with all its tags."""

    site: str
    version: MapVersion
    tags: tuple[Tag, ...]


def save(path: Path, served: ServedMap) -> None:
    """Raises DataError."""
    try:
        replace_file(path, encode(served))
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None


def load(path: Path, site: str) -> ServedMap | None:
    """None where there is none. Raises DataError: not a map, or of another site."""
    try:
        served = decode(ServedMap, path.read_bytes(), MOST_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None
    except RecordRefused as error:
        raise DataError(f"{path}: not a map: {error.reason}") from None
    if served.site != site:
        raise DataError(f"{path}: a map of site {served.site}, this is {site}")
    return served


def tags_of(payload: bytes) -> tuple[Tag, ...]:
    """The list that `map/tags` answers. Raises RecordRefused."""
    if len(payload) > MOST_BYTES:
        raise RecordRefused(f"too large: {len(payload)} bytes, at most {MOST_BYTES}")
    try:
        tags = msgspec.msgpack.decode(payload, type=tuple[Tag, ...])
    except (msgspec.DecodeError, RecursionError, OverflowError, UnicodeDecodeError) as error:
        raise RecordRefused(f"invalid: {error}") from None
    unknown = next((tag for tag in tags if tag.v != VERSION), None)
    if unknown is not None:
        raise RecordRefused(f"tag {unknown.tag}: schema version {unknown.v}, expected {VERSION}")
    return tags
