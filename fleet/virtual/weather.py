"""What a connection does to the messages that pass it, repeatably."""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

MS_NS = 1_000_000

Parts: TypeAlias = tuple[bytes, ...]


@dataclass(frozen=True, slots=True)
class Weather:
    """Of one participant's connection with the router; all but the last two in each direction.

    fastest_ms, slowest_ms  how long a message takes; they arrive in the order in which they left
    lost, doubled           probabilities, of a message
    late, late_ms           probability that it is overtaken by all that follow for so long
    torn                    probability that it is cut short: nobody can decode it
    flipped                 probability that one bit of it is another one. What comes out may be a
                            valid message that nobody can tell from a true one
    per_s, queue            so many messages a second go to the participant, and so many wait; what
                            comes then is dropped: a slow consumer. None: any number
    """

    fastest_ms: float = 1.0
    slowest_ms: float = 5.0
    lost: float = 0.0
    doubled: float = 0.0
    late: float = 0.0
    late_ms: float = 500.0
    torn: float = 0.0
    flipped: float = 0.0
    per_s: float | None = None
    queue: int = 1024


CALM = Weather()


@dataclass(frozen=True, slots=True)
class Passage:
    """What arrives at the end of a way. is_late: others may overtake it there, too."""

    t_ns: int
    parts: Parts
    is_late: bool = False


@dataclass(frozen=True, slots=True)
class Spell:
    """Weather for a while."""

    from_ns: int
    until_ns: int
    weather: Weather


class Way:
    """One direction of a connection. `is_down`: to the participant, who may be a slow consumer."""

    def __init__(
        self, weather: Weather, seed: str, is_down: bool = False, spells: Sequence[Spell] = ()
    ) -> None:
        self._usual, self._is_down, self._spells = weather, is_down, spells
        self._rng = random.Random(seed)
        self._last_ns: dict[str, int] = {}
        self._free_ns = 0.0

    def carry(self, message: Passage, sender: str) -> list[Passage]:
        """When it arrives, how often, and what has become of it."""
        weather, chance = self._weather(message.t_ns), self._rng.random
        if chance() < weather.lost or not self._has_room(weather, message.t_ns):
            return []
        copies = 2 if chance() < weather.doubled else 1
        return [self._passed(weather, message, sender) for _ in range(copies)]

    def takes_ns(self, weather: Weather | None = None) -> int:
        """Of a message that is neither lost nor spoilt: routers see to those."""
        weather = weather or self._usual
        return round(self._rng.uniform(weather.fastest_ms, weather.slowest_ms) * MS_NS)

    def _weather(self, t_ns: int) -> Weather:
        return next(
            (one.weather for one in self._spells if one.from_ns <= t_ns < one.until_ns),
            self._usual,
        )

    def _passed(self, weather: Weather, message: Passage, sender: str) -> Passage:
        """Order is kept between two participants, but for what is late."""
        arrival_ns = max(message.t_ns + self.takes_ns(weather), round(self._free_ns))
        parts = self._spoilt(weather, message.parts)
        if self._rng.random() < weather.late:
            more_ns = round(self._rng.uniform(0.0, weather.late_ms) * MS_NS)
            return Passage(arrival_ns + more_ns, parts, True)
        if message.is_late:
            return Passage(arrival_ns, parts, True)
        self._last_ns[sender] = max(arrival_ns, self._last_ns.get(sender, 0))
        return Passage(self._last_ns[sender], parts)

    def _has_room(self, weather: Weather, t_ns: int) -> bool:
        if weather.per_s is None or not self._is_down:
            return True
        each_ns = 1e9 / weather.per_s
        if self._free_ns - t_ns > weather.queue * each_ns:
            return False
        self._free_ns = max(self._free_ns, t_ns) + each_ns
        return True

    def _spoilt(self, weather: Weather, parts: Parts) -> Parts:
        chance = self._rng.random
        if chance() < weather.torn:
            parts = tuple(
                part[: self._rng.randrange(len(part))] if part else part for part in parts
            )
        if chance() < weather.flipped:
            parts = tuple(self._flipped(part) if part else part for part in parts)
        return parts

    def _flipped(self, part: bytes) -> bytes:
        at, bit = self._rng.randrange(len(part)), 1 << self._rng.randrange(8)
        return part[:at] + bytes([part[at] ^ bit]) + part[at + 1 :]
