"""A tag's memory through a reader: which tag, what it holds, and a record written and checked."""

from dataclasses import dataclass

from robot_agent.rfid.reader import Failure, Inventory, RfidReader
from tagmap.errors import DataError, RecordRefused
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import Contents, encode_for, read
from tagmap.memory.writing import WritePlan, compare, plan_write


@dataclass(frozen=True, slots=True)
class Terms:
    """What a record has to satisfy: signed with `key` if there is one, of `site` if it is known."""

    key: bytes | None = None
    site: int | None = None


def only_tag(reader: RfidReader, window_s: float) -> str:
    """EPC of the one tag that answers within `window_s`. Raises DataError: none, several, or the
    reader failed."""
    heard = reader.inventory(window_s)
    if not isinstance(heard, Inventory):
        raise DataError(heard.detail)
    epcs = [tag.epc for tag in heard.tags]
    if len(epcs) != 1:
        found = (
            f"{len(epcs)} tags answer: {', '.join(epcs)}; say which" if epcs else "no tag answers"
        )
        raise DataError(f"{found}. A tag answers only while it is lit")
    return epcs[0]


def read_memory(reader: RfidReader, epc: str, timeout_s: float) -> bytes:
    """All of its user memory. Raises DataError."""
    found = reader.read_user(epc, 0, None, timeout_s)
    if isinstance(found, Failure):
        raise DataError(f"tag {epc} cannot be read, {found.reason}: {found.detail}")
    return b"".join(word.to_bytes(2, "big") for word in found.words)


def contents_of(memory: bytes, epc: str, terms: Terms) -> Contents:
    """Raises DataError where the memory is too small for any record."""
    try:
        return read(memory, epc, terms.key, terms.site)
    except RecordRefused as error:
        raise DataError(f"tag {epc}: {error.reason}") from None


def write_record(
    reader: RfidReader,
    epc: str,
    record: TagRecord,
    terms: Terms,
    timeout_s: float,
    thaw: bool = False,
) -> tuple[WritePlan | None, bytes]:
    """Read, plan, write, read back, compare. The plan, None where the record was there already,
    and the memory as it is then. Raises DataError, and leaves what counted before."""
    memory = read_memory(reader, epc, timeout_s)
    try:
        data = encode_for(len(memory), record, epc, terms.key)
        plan = plan_write(memory, data, epc, terms.key, terms.site, thaw)
    except (RecordRefused, ValueError) as error:
        raise DataError(f"tag {epc}: {error}") from None
    if plan is None:
        return None, memory
    written = reader.write_user(epc, plan.first_word, plan.words, timeout_s)
    if isinstance(written, Failure):
        raise DataError(f"tag {epc} is not written, {written.reason}: {written.detail}")
    memory = read_memory(reader, epc, timeout_s)
    wrong = compare(plan, memory)
    if wrong is not None:
        raise DataError(f"tag {epc} was written, but {wrong}")
    return plan, memory
