"""What becomes of the tags: where each hangs, and whether it can be seen, at any time."""

from bisect import bisect_right
from dataclasses import dataclass, replace

import numpy as np

from fleet.simulation.scenario.happenings import Event
from fleet.simulation.world.tags import Hanging
from tagmap.conventions import Array, Mask

CARRIED = ("moved", "swapped")


@dataclass(frozen=True, slots=True)
class TagsNow:
    """p, normal (N, 3); hung (N,): it is there; open (N,): and neither covered nor in somebody's
    hands; alive (N,): it answers where it is lit."""

    p: Array
    normal: Array
    hung: Mask
    open: Mask
    alive: Mask


@dataclass(frozen=True, slots=True)
class History:
    """`names` (N,) of the scene: duplicates, at the end, have the EPC of another."""

    names: tuple[str, ...]
    epcs: tuple[str, ...]
    from_ns: tuple[int, ...]
    states: tuple[TagsNow, ...]

    def at(self, t_ns: int) -> TagsNow:
        return self.states[self.number(t_ns)]

    def number(self, t_ns: int) -> int:
        """How many events came to pass."""
        return max(0, bisect_right(self.from_ns, t_ns) - 1)


def history(hanging: Hanging, events: tuple[Event, ...], start_ns: int) -> History:
    """Raises ConfigError for tags that there are not."""
    of_tags = sorted((e for e in events if e.tags), key=lambda event: event.at_s)
    copies = [event for event in of_tags if event.kind == "duplicated"]
    of = [hanging.index(event.tags[0], "event.tags") for event in copies]
    n, extra = len(hanging.names), len(copies)
    added = [f"{hanging.names[k]}-{number}" for number, k in enumerate(of, 2)]
    there = np.concatenate([np.ones(n, dtype=bool), np.zeros(extra, dtype=bool)])
    state = TagsNow(
        np.concatenate([hanging.p, hanging.p[of]]),
        np.concatenate([hanging.normal, hanging.normal[of]]),
        there,
        there,
        there,
    )
    from_ns, states, copied = [start_ns], [state], 0
    for at_s, event, is_end in _in_order(of_tags):
        index = [hanging.index(ref, "event.tags") for ref in event.tags]
        if event.kind == "duplicated":
            index, copied = [n + copied], copied + 1
        state = _hung(index, state) if is_end else _after(event, index, state)
        from_ns.append(start_ns + round(at_s * 1e9))
        states.append(state)
    epcs = (*hanging.names, *(hanging.names[k] for k in of))
    return History((*hanging.names, *added), epcs, tuple(from_ns), tuple(states))


def _in_order(events: list[Event]) -> list[tuple[float, Event, bool]]:
    """When each begins, and when those that take time end."""
    begin = [(event.at_s, event, False) for event in events]
    carried = [event for event in events if event.kind in CARRIED and event.takes_s]
    end = [(event.at_s + event.takes_s, event, True) for event in carried]
    return sorted(begin + end, key=lambda one: one[0])


def _hung(index: list[int], before: TagsNow) -> TagsNow:
    is_open = before.open.copy()
    is_open[index] = True
    return replace(before, open=is_open)


def _after(event: Event, index: list[int], before: TagsNow) -> TagsNow:
    p, normal = before.p.copy(), before.normal.copy()
    hung, is_open, alive = before.hung.copy(), before.open.copy(), before.alive.copy()
    if event.kind in ("moved", "duplicated"):
        p[index] = p[index] + np.array(event.by_m) if event.to_m is None else np.array(event.to_m)
    if event.kind == "swapped":
        p[index], normal[index] = before.p[index[::-1]], before.normal[index[::-1]]
    if event.kind == "duplicated":
        hung[index] = is_open[index] = alive[index] = True
    if event.kind in CARRIED and event.takes_s:
        is_open[index] = False
    if event.kind in ("covered", "uncovered"):
        is_open[index] = event.kind == "uncovered"
    if event.kind == "dead":
        alive[index] = False
    return TagsNow(p, normal, hung, is_open, alive)
