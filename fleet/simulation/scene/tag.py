"""One tag: what it is, where it hangs, and what is wrong with it."""

import math
from dataclasses import dataclass, field
from typing import TypeAlias

from fleet.simulation.scene.light import Light
from fleet.simulation.scene.memory import UserMemory

Place: TypeAlias = tuple[float, float, float]

RESERVED, EPC, TID, USER = range(4)
"""Memory banks of Gen2."""
SWITCH_ON_NS = 2_000_000
OUTAGE_NS = 200_000_000
_CRC_OF_AIR = 0


@dataclass(slots=True)
class TagFaults:
    """dead: never answers. deaf: answers inventories but obeys no command. stray: probability
    that it answers a round in the dark, by light that was meant for another.

    power_fails_after: words written until power is lost for OUTAGE_NS, once for each entry.
    """

    dead: bool = False
    deaf: bool = False
    stray: float = 0.0
    power_fails_after: list[int] = field(default_factory=list)


@dataclass(slots=True)
class Tag:
    """`name` is unique in a scene, `epc` (hex) need not be: tags are sold twice.

    p_map (3,) in m. `lights` shine on this tag apart from the lasers of the scene.
    """

    name: str
    epc: str
    memory: UserMemory
    tid: str = "e2003412"
    p_map: Place = (0.0, 0.0, 0.0)
    switch_on_ns: int = SWITCH_ON_NS
    lights: tuple[Light, ...] = ()
    faults: TagFaults = field(default_factory=TagFaults)
    _no_power_until_ns: int = 0

    def has_power(self, lit_since_ns: int | None, t_ns: int) -> bool:
        if lit_since_ns is None or t_ns < self._no_power_until_ns:
            return False
        return t_ns - max(lit_since_ns, self._no_power_until_ns) >= self.switch_on_ns

    def words(self, bank: int) -> tuple[int, ...] | None:
        """What is readable of a bank; None: nothing is."""
        if bank == EPC:
            protocol_control = (len(self.epc) // 4) << 11
            return (_CRC_OF_AIR, protocol_control, *words_of(self.epc))
        if bank == TID:
            return words_of(self.tid)
        return self.memory.words if bank == USER else None

    def word_written(self, t_ns: int) -> None:
        """Count towards the next power failure."""
        if not self.faults.power_fails_after:
            return
        self.faults.power_fails_after[0] -= 1
        if self.faults.power_fails_after[0] <= 0:
            del self.faults.power_fails_after[0]
            self._no_power_until_ns = t_ns + OUTAGE_NS

    def distance_m(self, p_map: Place) -> float:
        return math.dist(self.p_map, p_map)


def words_of(digits: str) -> tuple[int, ...]:
    """Words of 16 bits from hex digits, four each."""
    return tuple(int(digits[i : i + 4], 16) for i in range(0, len(digits), 4))
