"""Bytes to records and back: the one place where what arrives from outside is decoded."""

from functools import cache
from typing import TypeVar, cast

import msgspec

from tagmap.errors import RecordRefused
from tagmap.records.base import VERSION, Message

MAX_BYTES = 65536

M = TypeVar("M", bound=Message)

_NOT_DECODABLE = (msgspec.DecodeError, RecursionError, OverflowError, UnicodeDecodeError)


class Address(msgspec.Struct, frozen=True):
    """What can still be read of a keyframe that is otherwise not acceptable."""

    session: str
    seq: int


class _Version(msgspec.Struct):
    v: int


_version_decoder = msgspec.msgpack.Decoder(_Version)
_address_decoder = msgspec.msgpack.Decoder(Address)
_encoder = msgspec.msgpack.Encoder()


@cache
def _decoder(message_type: type[Message]) -> msgspec.msgpack.Decoder[Message]:
    return msgspec.msgpack.Decoder(message_type)


def encode(message: Message) -> bytes:
    """A msgpack map with named fields."""
    return _encoder.encode(message)


def decode(message_type: type[M], payload: bytes, max_bytes: int = MAX_BYTES) -> M:
    """Raise RecordRefused, and nothing else, on anything that is not a valid `message_type`."""
    if len(payload) > max_bytes:
        raise RecordRefused(f"too large: {len(payload)} bytes, at most {max_bytes}")
    try:
        version = _version_decoder.decode(payload).v
    except _NOT_DECODABLE as error:
        raise RecordRefused(f"malformed: {error}") from None
    if version != VERSION:
        raise RecordRefused(f"unsupported schema version {version}, expected {VERSION}")
    try:
        return cast(M, _decoder(message_type).decode(payload))
    except _NOT_DECODABLE as error:
        raise RecordRefused(f"invalid: {error}") from None


def address_of(payload: bytes) -> Address | None:
    """Session and seq of a refused keyframe, or None where not even they can be read."""
    try:
        return _address_decoder.decode(payload[:MAX_BYTES])
    except _NOT_DECODABLE:
        return None
