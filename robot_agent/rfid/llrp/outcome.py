"""From what the reader reported to what the agent is told."""

from collections.abc import Iterable, Sequence

from robot_agent.rfid.llrp.codec import Message, part
from robot_agent.rfid.llrp.reports import Fact, Sighting, WindowEvent
from robot_agent.rfid.reader import Failure, Heard, Inventory, ReaderInfo, Reason, UserWords

PER_S = 1e6
"""Microseconds."""

READ_RESULTS: dict[int, Reason] = {
    1: "tag_error",
    2: "no_answer",
    3: "reader_error",
    4: "overrun",
    5: "locked",
}
"""C1G2ReadResultType; 4 and 5 came with LLRP 1.1."""
WRITE_RESULTS: dict[int, Reason] = {
    1: "overrun",
    2: "locked",
    3: "no_power",
    4: "tag_error",
    5: "no_answer",
    6: "reader_error",
}
"""C1G2WriteResultType."""


def reader_info(address: str, answer: Message) -> ReaderInfo | Failure:
    device = part(answer, "GeneralDeviceCapabilities")
    if device is None:
        return Failure("reader_error", f"{address} does not say what it is")
    return ReaderInfo(
        address,
        device.DeviceManufacturerName,
        device.ModelName,
        device.ReaderFirmwareVersion,
        device.MaxNumberOfAntennaSupported,
    )


def inventory(facts: Sequence[Fact], started_ns: int, ended_ns: int) -> Inventory:
    begun_us = _begun_us(facts)
    by_epc: dict[str, list[Sighting]] = {}
    for seen in _sightings(facts):
        if begun_us is None or seen.last_us is None or seen.last_us >= begun_us:
            by_epc.setdefault(seen.epc, []).append(seen)
    tags = (_heard(epc, seen, begun_us) for epc, seen in sorted(by_epc.items()))
    return Inventory(tuple(tags), started_ns, ended_ns)


def read(
    facts: Sequence[Fact], epc: str, start: int, count: int | None, timeout_s: float
) -> UserWords | Failure:
    seen = _obeyed(facts, epc)
    if isinstance(seen, Failure):
        return seen
    if seen is None or seen.read is None:
        return _unheard(facts, epc, timeout_s)
    if seen.read.Result != 0:
        what = f"reading {_span(start, count)} of {epc}"
        return _denied(READ_RESULTS, seen.read.Result, what, None)
    words = tuple(seen.read.ReadData)
    if count is not None and len(words) != count:
        got = f"{epc} gave {len(words)} words from {start}, expected {count}"
        return Failure("reader_error", got)
    return UserWords(epc, start, words)


def written(
    facts: Sequence[Fact], epc: str, start: int, words: tuple[int, ...], timeout_s: float
) -> UserWords | Failure:
    """Only what was read back as it was written counts as written."""
    seen = _obeyed(facts, epc)
    if isinstance(seen, Failure):
        return seen
    if seen is None or seen.written is None:
        return _unheard(facts, epc, timeout_s)
    done, n = seen.written.NumWordsWritten, len(words)
    what = f"writing {_span(start, n)} of {epc}"
    if 0 < done < n:
        why = WRITE_RESULTS.get(seen.written.Result, "reader_error")
        return Failure("partial", f"{what}: {done} of {n} written, then {why}", done)
    if seen.written.Result != 0:
        return _denied(WRITE_RESULTS, seen.written.Result, what, done)
    if seen.read is None or seen.read.Result != 0:
        return Failure("partial", f"{what}: acknowledged, but could not be read back", done)
    back = tuple(seen.read.ReadData)
    if back != words:
        return Failure("partial", f"{what}: {_difference(back, words, start)}", done)
    return UserWords(epc, start, words)


def _begun_us(facts: Iterable[Fact]) -> int | None:
    events = (fact for fact in facts if isinstance(fact, WindowEvent))
    return next((event.t_us for event in events if not event.ended), None)


def _sightings(facts: Iterable[Fact]) -> list[Sighting]:
    return [fact for fact in facts if isinstance(fact, Sighting)]


def _heard(epc: str, seen: Sequence[Sighting], begun_us: int | None) -> Heard:
    first = [one.first_us for one in seen if one.first_us is not None]
    last = [one.last_us for one in seen if one.last_us is not None]
    count = sum(one.count for one in seen)
    if begun_us is None or not first or not last:
        return Heard(epc, count)
    return Heard(epc, count, (min(first) - begun_us) / PER_S, (max(last) - begun_us) / PER_S)


def _obeyed(facts: Iterable[Fact], epc: str) -> Sighting | Failure | None:
    """The report of the commands; None: there is none. A Failure where the reader picked a tag
    that was not asked for."""
    for seen in _sightings(facts):
        if seen.read is not None or seen.written is not None:
            if seen.epc == epc:
                return seen
            return Failure("reader_error", f"the reader addressed {seen.epc} instead of {epc}")
    return None


def _unheard(facts: Iterable[Fact], epc: str, timeout_s: float) -> Failure:
    heard = sorted({seen.epc for seen in _sightings(facts)})
    within = f"within {timeout_s:g} s"
    if epc in heard:
        return Failure("no_answer", f"{epc} was heard, but answered no command {within}")
    if heard:
        others = ", ".join(heard[:3]) + (", ..." if len(heard) > 3 else "")
        return Failure("other_tags_only", f"{epc} was not heard {within}, but {others}")
    return Failure("nothing_heard", f"neither {epc} nor any other tag was heard {within}")


def _denied(results: dict[int, Reason], result: int, what: str, done: int | None) -> Failure:
    reason = results.get(result, "reader_error")
    return Failure(reason, f"{what}: {_SAID.get(reason, f'result {result}')}", done)


_SAID: dict[Reason, str] = {
    "locked": "the memory is locked",
    "overrun": "the memory is shorter than that",
    "no_power": "the tag hears the reader, but lacks the power to write: go nearer",
    "no_answer": "the tag stopped answering",
    "tag_error": "the tag refused without saying why; its memory may be shorter",
    "reader_error": "the reader failed",
}


def _span(start: int, count: int | None) -> str:
    if count is None:
        return f"all words from {start}"
    return f"words {start} to {start + count - 1}"


def _difference(back: Sequence[int], words: Sequence[int], start: int) -> str:
    if len(back) != len(words):
        return f"{len(back)} words came back, expected {len(words)}"
    i = next(i for i, (got, meant) in enumerate(zip(back, words, strict=True)) if got != meant)
    return f"word {start + i} reads {back[i]:04x}, expected {words[i]:04x}"
