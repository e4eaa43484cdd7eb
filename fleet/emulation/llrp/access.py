"""Commands to one tag, word by word: each takes its time, and power may fail in between."""

from collections.abc import Generator, Sequence
from typing import TypeAlias

from fleet.emulation.llrp.specs import AccessSpec
from fleet.simulation.scene.antenna import READ_NS, WRITE_WORD_NS, AirError, Antenna, Reply
from robot_agent.rfid.llrp.codec import Message, llrp, name_of

Wake: TypeAlias = Generator[int, int, list[Message]]
"""Yields when to go on, is sent the time it then is, returns results."""

READ_RESULTS: dict[AirError, int] = {"silent": 2, "overrun": 1, "locked": 1, "no_power": 2}
"""LLRP 1.0.1 has no words for why a tag cannot be read."""
WRITE_RESULTS: dict[AirError, int] = {"overrun": 1, "locked": 2, "no_power": 3, "silent": 5}
EPC_BANK = 1


def matches(spec: AccessSpec, antenna: Antenna, reply: Reply, t_ns: int) -> bool:
    """Whether the tag is the one that the specification aims at: all patterns agree."""
    return all(_agrees(target, antenna, reply, t_ns) for target in spec.targets)


def obey(commands: Sequence[Message], antenna: Antenna, reply: Reply, t_ns: int) -> Wake:
    """Carry out commands in order until one fails."""
    results: list[Message] = []
    for command in commands:
        if name_of(command) == "C1G2Read":
            t_ns = yield t_ns + READ_NS
            result = _read(command, antenna, reply, t_ns)
        else:
            result = yield from _write(command, antenna, reply, t_ns)
        results.append(result)
        if result.Result != 0:
            break
    return results


def _read(command: Message, antenna: Antenna, reply: Reply, t_ns: int) -> Message:
    words = antenna.read(reply.handle, command.MB, command.WordPointer, command.WordCount, t_ns)
    result = llrp().C1G2ReadOpSpecResult_Parameter(OpSpecID=command.OpSpecID)
    if isinstance(words, str):
        result.Result = READ_RESULTS[words]
    else:
        result.ReadData = list(words)
    return result


def _write(
    command: Message, antenna: Antenna, reply: Reply, t_ns: int
) -> Generator[int, int, Message]:
    result = llrp().C1G2WriteOpSpecResult_Parameter(OpSpecID=command.OpSpecID)
    for i, word in enumerate(command.WriteData):
        t_ns = yield t_ns + WRITE_WORD_NS
        error = antenna.write(reply.handle, command.MB, command.WordPointer + i, word, t_ns)
        if error is not None:
            result.Result = WRITE_RESULTS[error]
            break
        result.NumWordsWritten = i + 1
    return result


def _agrees(target: Message, antenna: Antenna, reply: Reply, t_ns: int) -> bool:
    """Bits of a memory bank against data under a mask; a tag whose bank ends before does not."""
    length = 8 * len(target.TagMask)
    if length == 0:
        return bool(target.Match)
    if target.MB == EPC_BANK:
        bank = _epc_bank(reply.epc)
    else:
        words = antenna.read(reply.handle, target.MB, 0, 0, t_ns)
        bank = b"" if isinstance(words, str) else b"".join(word.to_bytes(2) for word in words)
    there = _bits(bank, target.Pointer, length)
    mask = int.from_bytes(target.TagMask)
    data = int.from_bytes(target.TagData[: len(target.TagMask)].ljust(len(target.TagMask), b"\0"))
    same = there is not None and there & mask == data & mask
    return same == bool(target.Match)


def _epc_bank(epc: str) -> bytes:
    """CRC, which nobody masks, protocol control word, EPC: known from the reply itself."""
    return bytes(2) + ((len(epc) // 4) << 11).to_bytes(2) + bytes.fromhex(epc)


def _bits(bank: bytes, start: int, length: int) -> int | None:
    behind = 8 * len(bank) - start - length
    if behind < 0:
        return None
    return (int.from_bytes(bank) >> behind) & ((1 << length) - 1)
