"""Messages to bytes and back. The only file that knows where pyllrp is."""

from functools import cache
from typing import Any, TypeAlias

from robot_agent.rfid.llrp.frames import Frame
from tagmap.errors import TagmapError

Message: TypeAlias = Any
"""An object of pyllrp, whose classes are made at import."""

EXTRA = "pip install tagmap[llrp]"


class LlrpUnavailable(TagmapError):
    """What the driver needs is not installed."""


class Undecodable(Exception):
    """A message whose inside makes no sense; the stream goes on behind it."""


@cache
def llrp() -> Any:
    """The pyllrp module. Raises LlrpUnavailable, which says what to install."""
    try:
        import bitstring
        from pyllrp import pyllrp
    except ImportError as error:
        raise LlrpUnavailable(f"LLRP readers need pyllrp ({error}): {EXTRA}") from None
    if not hasattr(bitstring, "BitStream"):
        found = getattr(bitstring, "__version__", "unknown")
        raise LlrpUnavailable(f"pyllrp needs bitstring < 5, found {found}: {EXTRA}")
    return pyllrp


def encode(message: Message) -> bytes:
    packed: bytes = llrp().PackMessage(message).tobytes()
    return packed


def decode(frame: Frame) -> Message:
    """Raises Undecodable, whatever the bytes are."""
    import bitstring

    try:
        return _with_numbers(llrp().UnpackMessage(bitstring.ConstBitStream(bytes=frame.content)))
    except Exception as error:
        # pyllrp has no errors of its own: it fails by whatever the bytes happen to break.
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise Undecodable(
            f"message of type {frame.kind}, {len(frame.content)} bytes: {why}"
        ) from None


def name_of(message: Message) -> str:
    """As in the specification: ADD_ROSPEC, TagReportData."""
    name: str = message.Name
    return name


def part(message: Message, name: str) -> Message | None:
    """The first parameter of that name directly in a message or parameter."""
    return next(parts(message, name), None)


def parts(message: Message, name: str) -> Any:
    return (inner for inner in message.Parameters if inner.Name == name)


def _with_numbers(message: Message) -> Message:
    """pyllrp takes numbers for fields of single bits, but leaves bitstrings there itself."""
    for definition in message.FieldDefs:
        if definition.TypeCode.startswith("bits"):
            setattr(message, definition.Name, getattr(message, definition.Name).uint)
    for inner in message.Parameters:
        _with_numbers(inner)
    return message
