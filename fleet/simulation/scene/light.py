"""Which tags have light on their switch, and since when."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Protocol


class Light(Protocol):
    def lit_since(self, tag: str, t_ns: int) -> int | None:
        """Since when `tag` has been lit without a break at `t_ns`; None: it is dark."""


@dataclass(frozen=True, slots=True)
class Always:
    def lit_since(self, _tag: str, _t_ns: int) -> int | None:
        return 0


@dataclass(frozen=True, slots=True)
class Schedule:
    """Lit for the first `on_ns` of every `period_ns`, counted from `start_ns`, dark before."""

    period_ns: int
    on_ns: int
    start_ns: int = 0

    def lit_since(self, _tag: str, t_ns: int) -> int | None:
        if t_ns < self.start_ns:
            return None
        into = (t_ns - self.start_ns) % self.period_ns
        return t_ns - into if into < self.on_ns else None


@dataclass(frozen=True, slots=True)
class _Beam:
    """Since when the beam has been on which tags, and until when."""

    since_ns: dict[str, int]
    until_ns: float


@dataclass(slots=True)
class Beams:
    """Lasers, each with the tags that its beam is on at present: none, one, rarely more."""

    _on: dict[str, _Beam] = field(default_factory=dict)

    def shine(self, laser: str, tags: Iterable[str], t_ns: int, until_ns: float = math.inf) -> None:
        """From `t_ns` to `until_ns` the beam of `laser` is on `tags` and on no others."""
        beam = self._on.get(laser)
        before = beam.since_ns if beam is not None and t_ns <= beam.until_ns else {}
        self._on[laser] = _Beam({tag: before.get(tag, t_ns) for tag in tags}, until_ns)

    def lit_since(self, tag: str, t_ns: int) -> int | None:
        first: int | None = None
        for beam in self._on.values():
            at_ns = beam.since_ns.get(tag)
            if at_ns is None or not at_ns <= t_ns < beam.until_ns:
                continue
            first = at_ns if first is None else min(first, at_ns)
        return first
