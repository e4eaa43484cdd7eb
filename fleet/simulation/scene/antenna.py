"""What one reader can do over the air: all that an emulated reader knows of the scene."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

from fleet.simulation.scene import chance
from fleet.simulation.scene.tag import USER, Place, Tag

if TYPE_CHECKING:
    from fleet.simulation.scene.scene import Scene

ROUND_NS = 20_000_000
READ_NS = 2_000_000
WRITE_WORD_NS = 3_000_000
"""How long a round of inventory, reading, and writing one word take."""

AirError: TypeAlias = Literal["silent", "overrun", "locked", "no_power"]


@dataclass(frozen=True, slots=True)
class Reply:
    """One answer to an inventory. `handle` addresses the tag in later commands, as the random
    number of Gen2 does; it says nothing about the tag."""

    epc: str
    handle: int


@dataclass(slots=True)
class Reader:
    """Where a reader is and what its radio can do. Writing needs more power than reading.

    missed: probability that a reply is not heard. phantom: probability of a reply that no tag gave,
    in a round.
    """

    name: str
    p_map: Place = (0.0, 0.0, 0.0)
    range_m: float = 85.0
    write_range_m: float = 30.0
    missed: float = 0.0
    phantom: float = 0.0


class Antenna:
    """The air of `scene` as `reader` hears it. `t_ns` is when a command begins."""

    def __init__(self, scene: "Scene", reader: Reader) -> None:
        self._scene = scene
        self._reader = reader

    def hear(self, t_ns: int) -> tuple[Reply, ...]:
        """One inventory round: who answers, in no order that tells anything."""
        with self._scene.lock:
            replies = [
                Reply(tag.epc, handle)
                for handle, tag in enumerate(self._scene.tags)
                if self._answers(tag, t_ns) and not self._is_missed(tag, t_ns)
            ]
        if self._happens(self._reader.phantom, "phantom", t_ns):
            replies.append(Reply(self._phantom(t_ns), -1))
        return tuple(sorted(replies, key=lambda reply: reply.epc))

    def read(
        self, handle: int, bank: int, start: int, count: int, t_ns: int
    ) -> tuple[int, ...] | AirError:
        """Words of a memory bank; `count` 0 means all there are from `start` on."""
        with self._scene.lock:
            tag = self._commanded(handle, t_ns)
            if tag is None:
                return "silent"
            words = tag.words(bank)
            if words is None:
                return "locked"
            end = start + count if count else len(words)
            return words[start:end] if start < end <= len(words) else "overrun"

    def write(self, handle: int, bank: int, address: int, word: int, t_ns: int) -> AirError | None:
        """One word; None: the tag acknowledged it. Only user memory can be written."""
        with self._scene.lock:
            tag = self._commanded(handle, t_ns)
            if tag is None:
                return "silent"
            if bank != USER:
                return "locked"
            if tag.distance_m(self._reader.p_map) > self._reader.write_range_m:
                return "no_power"
            denial = tag.memory.write(address, word)
            if denial is None:
                tag.word_written(t_ns)
            return denial

    def _commanded(self, handle: int, t_ns: int) -> Tag | None:
        """The tag if it obeys a command now. Readers repeat commands, so none is lost by chance."""
        tag = self._scene.tags[handle] if 0 <= handle < len(self._scene.tags) else None
        if tag is None or tag.faults.deaf or not self._answers(tag, t_ns):
            return None
        return tag

    def _answers(self, tag: Tag, t_ns: int) -> bool:
        since_ns = self._scene.lit_since(tag, t_ns)
        # Nearly all are in the dark.
        if tag.faults.dead or (since_ns is None and not tag.faults.stray):
            return False
        if tag.distance_m(self._reader.p_map) > self._reader.range_m:
            return False
        if tag.has_power(since_ns, t_ns):
            return True
        return self._happens(tag.faults.stray, "stray", t_ns, tag)

    def _is_missed(self, tag: Tag, t_ns: int) -> bool:
        return self._happens(self._reader.missed, "missed", t_ns, tag)

    def _happens(self, probability: float, what: str, t_ns: int, tag: Tag | None = None) -> bool:
        name = tag.name if tag else ""
        return chance.happens(probability, self._scene.seed, what, self._reader.name, t_ns, name)

    def _phantom(self, t_ns: int) -> str:
        """An EPC of 96 bits that no tag has."""
        high, low = (
            chance.bits(self._scene.seed, half, self._reader.name, t_ns) for half in ("high", "low")
        )
        return f"{high & 0xFFFFFFFF:08x}{low:016x}"
