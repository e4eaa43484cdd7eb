"""Which tags have light on their switch, and since when."""

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


@dataclass(slots=True)
class Beams:
    """Lasers, each with the tags that its beam is on at present: none, one, rarely more."""

    _on: dict[str, dict[str, int]] = field(default_factory=dict)

    def shine(self, laser: str, tags: Iterable[str], t_ns: int) -> None:
        """From `t_ns` on the beam of `laser` is on `tags` and on no others."""
        before = self._on.get(laser, {})
        self._on[laser] = {tag: before.get(tag, t_ns) for tag in tags}

    def lit_since(self, tag: str, t_ns: int) -> int | None:
        since = [on[tag] for on in self._on.values() if tag in on and on[tag] <= t_ns]
        return min(since, default=None)
