"""A tag's whole memory: which form fits, what its slots say, and which record counts."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from tagmap.errors import RecordRefused
from tagmap.memory import compact, full
from tagmap.memory.record import TagRecord

Form: TypeAlias = Literal["full", "compact"]

SLOT_NAMES = "AB"


@dataclass(frozen=True, slots=True)
class Layout:
    """`slots` of `slot_bytes` each, one directly after the other from byte 0 on.

    With two slots a write goes to the one that does not count, so a torn write costs nothing. With
    one it costs the record until it is written again.
    """

    form: Form
    slots: int
    slot_bytes: int

    def encode(self, record: TagRecord, tag: str, key: bytes | None) -> bytes:
        if self.form == "full":
            return full.encode(record, tag, key)
        return compact.encode(record, tag)

    def decode(self, data: bytes, tag: str, key: bytes | None) -> TagRecord:
        if self.form == "full":
            return full.decode(data, tag, key)
        return compact.decode(data, tag)

    def slice(self, slot: int) -> slice:
        return slice(slot * self.slot_bytes, (slot + 1) * self.slot_bytes)


def layout_of(memory_bytes: int, signed: bool = False) -> Layout:
    """The most exact form that fits, twice where there is room. RecordRefused where none does.

    A signed site has no compact form: there is no room for a signature.
    """
    size = full.BYTES + (full.SIGNATURE_BYTES if signed else 0)
    if memory_bytes >= size:
        return Layout("full", 2 if memory_bytes >= 2 * size else 1, size)
    if memory_bytes >= compact.BYTES and not signed:
        return Layout("compact", 2 if memory_bytes >= 2 * compact.BYTES else 1, compact.BYTES)
    least = size if signed else compact.BYTES
    raise RecordRefused(f"a memory of {memory_bytes} bytes, expected at least {least}")


@dataclass(frozen=True, slots=True)
class Contents:
    """`slots`: the record of each, or why it is refused. `newest`: the slot that counts, if any."""

    layout: Layout
    slots: tuple[TagRecord | str, ...]
    newest: int | None

    @property
    def record(self) -> TagRecord | None:
        held = None if self.newest is None else self.slots[self.newest]
        return held if isinstance(held, TagRecord) else None

    @property
    def reason(self) -> str | None:
        """Why there is no record."""
        if self.record is not None:
            return None
        return "; ".join(f"slot {SLOT_NAMES[i]}: {held}" for i, held in enumerate(self.slots))


def read(memory: bytes, tag: str, key: bytes | None = None, site: int | None = None) -> Contents:
    """RecordRefused where the memory is too small for any form.

    With `site`, a record of another site does not count.
    """
    layout = layout_of(len(memory), key is not None)
    slots = tuple(
        _held(layout, memory[layout.slice(i)], tag, key, site) for i in range(layout.slots)
    )
    valid = [i for i, held in enumerate(slots) if isinstance(held, TagRecord)]
    newest = valid[0] if valid else None
    if len(valid) == 2:
        a, b = slots
        assert isinstance(a, TagRecord)
        assert isinstance(b, TagRecord)
        newest = 1 if is_newer(b, a) else 0
    return Contents(layout, slots, newest)


def encode_for(memory_bytes: int, record: TagRecord, tag: str, key: bytes | None = None) -> bytes:
    """The record in the form that a memory of this size has room for. RecordRefused where it has
    room for none, ValueError where that form cannot hold the record."""
    return layout_of(memory_bytes, key is not None).encode(record, tag, key)


def is_newer(a: TagRecord, b: TagRecord) -> bool:
    """Higher map version, then time. Where only 16 bits of the version are known they may have
    gone round (serial number arithmetic, RFC 1982)."""
    if a.t_s is None or b.t_s is None:
        return 0 < (a.map_version - b.map_version) & 0xFFFF < 0x8000
    return (a.map_version, a.t_s) > (b.map_version, b.t_s)


def _held(
    layout: Layout, data: bytes, tag: str, key: bytes | None, site: int | None
) -> TagRecord | str:
    try:
        record = layout.decode(data, tag, key)
    except RecordRefused as error:
        return error.reason
    if site is not None and record.site not in (None, site):
        return f"of site {record.site}, this is {site}"
    return record
