"""Write, read back, compare: what to write where, and whether it is there."""

from dataclasses import dataclass

from msgspec.structs import replace

from tagmap.errors import RecordRefused
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import SLOT_NAMES, is_newer, read

ENDURED_WRITES = 100_000


@dataclass(frozen=True, slots=True)
class WritePlan:
    """Write `words` (16 bits each) from word `first_word` of the user memory on."""

    slot: int
    first_word: int
    words: tuple[int, ...]

    @property
    def data(self) -> bytes:
        return b"".join(word.to_bytes(2, "big") for word in self.words)


def plan_write(
    memory: bytes,
    data: bytes,
    tag: str,
    key: bytes | None = None,
    site: int | None = None,
    thaw: bool = False,
) -> WritePlan | None:
    """How the record `data`, encoded for this memory, gets there; None where it counts already.

    Into a slot that holds nothing valid, else the older one, so that until the last byte is written
    the record that counted before still does. RecordRefused where `data` is no record that fits
    here, and where it would not count: what is there is newer, or frozen without leave to `thaw`.
    """
    contents = read(memory, tag, key, site)
    layout = contents.layout
    record = layout.decode(data, tag, key)
    if contents.record is not None:
        if say_the_same(contents.record, record):
            return None
        _check_counts(contents.record, record, thaw)
    slot = 1 - contents.newest if contents.newest is not None and layout.slots == 2 else 0
    words = tuple(int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2))
    return WritePlan(slot, slot * layout.slot_bytes // 2, words)


def say_the_same(a: TagRecord, b: TagRecord) -> bool:
    """Whoever wrote them: a job that was given to a second robot is not done twice."""
    return replace(a, robot=None) == replace(b, robot=None)


def compare(plan: WritePlan, memory: bytes) -> str | None:
    """What is wrong with the memory as it was read back, or None."""
    first = 2 * plan.first_word
    found = memory[first : first + 2 * len(plan.words)]
    wrong = [i for i, byte in enumerate(plan.data) if i >= len(found) or found[i] != byte]
    if not wrong:
        return None
    name = SLOT_NAMES[plan.slot]
    return f"slot {name}: {len(wrong)} of {len(plan.data)} bytes differ, first byte {wrong[0]}"


def wear(writes: int, slots: int) -> float:
    """The share of its endurance that the most used cell has behind it: slots take turns."""
    return -(-writes // slots) / ENDURED_WRITES


def _check_counts(held: TagRecord, record: TagRecord, thaw: bool) -> None:
    if held.frozen and not thaw:
        raise RecordRefused("the record there is frozen")
    if not is_newer(record, held):
        raise RecordRefused(
            f"the record there is of map version {held.map_version}, time {held.t_s} s: "
            f"not older than version {record.map_version}, time {record.t_s} s"
        )
