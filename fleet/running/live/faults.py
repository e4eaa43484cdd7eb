"""The faults of a scenario as what is done to real processes and their lines, and when."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from msgspec.structs import replace

from fleet.running.supervisor import ROUTER, SERVICE
from fleet.simulation.scenario.description import Scenario
from fleet.simulation.scenario.happenings import Fault, FaultKind
from fleet.simulation.world.world import World
from fleet.virtual.faults import DOWN_S, LASTING_S, healed_ns

ONLY_VIRTUAL: tuple[FaultKind, ...] = ("duplicate", "reorder", "corrupt")
"""Of single messages, which nobody outside Zenoh can tell apart in its stream."""
SLOW_BYTES_PER_S = 4000.0
NS = 1e9


class Hands(Protocol):
    """What can be done to a running site; `who` as in Supervisor."""

    def kill(self, who: str, down_s: float) -> None: ...
    def cut(self, who: str) -> None: ...
    def heal(self, who: str) -> None: ...
    def slow(self, who: str, bytes_per_s: float | None) -> None: ...
    def fill_disk(self) -> None: ...
    def make_room(self) -> None: ...


@dataclass(frozen=True, slots=True)
class Act:
    """what: in words, for people who watch."""

    at_ns: int
    what: str
    do: Callable[[], None]


def without_virtual(scenario: Scenario) -> tuple[Scenario, list[Fault]]:
    """What of it can happen in true time, and the faults that cannot."""
    left = [fault for fault in scenario.fault if fault.kind in ONLY_VIRTUAL]
    kept = tuple(fault for fault in scenario.fault if fault.kind not in ONLY_VIRTUAL)
    return replace(scenario, fault=kept), left


def planned(world: World, hands: Hands) -> list[Act]:
    """In order. What happens to clocks, batteries and tags is the world's and not done here."""
    faults = sorted(world.scenario.fault, key=lambda fault: fault.at_s)
    acts = [act for fault in faults for act in _acts(world, hands, fault, faults)]
    return sorted(acts, key=lambda act: act.at_ns)


def _acts(world: World, hands: Hands, fault: Fault, all_of: list[Fault]) -> Iterator[Act]:
    at_ns = world.start_ns + round(NS * fault.at_s)
    until_ns = at_ns + round(NS * (fault.for_s or LASTING_S))
    whom = [*world.robots, SERVICE] if fault.target is None else [fault.target]
    if fault.kind in DOWN_S:
        who = {"kill-router": ROUTER, "kill-service": SERVICE}.get(fault.kind, whom[0])
        down_s = fault.for_s or DOWN_S[fault.kind]
        yield Act(at_ns, f"kill {who}", partial(hands.kill, who, down_s))
    elif fault.kind == "partition":
        for who in whom:
            yield Act(at_ns, f"cut off {who}", partial(hands.cut, who))
            heal_ns = healed_ns(world, who, fault, all_of)
            if heal_ns is not None:
                yield Act(heal_ns, f"heal {who}", partial(hands.heal, who))
    elif fault.kind == "slow-consumer":
        for who in whom:
            slow = f"{who} gets {SLOW_BYTES_PER_S:g} bytes a second"
            yield Act(at_ns, slow, partial(hands.slow, who, SLOW_BYTES_PER_S))
            yield Act(until_ns, f"{who} gets all", partial(hands.slow, who, None))
    elif fault.kind == "full-disk":
        yield Act(at_ns, "the service's disk is full", hands.fill_disk)
        yield Act(until_ns, "there is room on it again", hands.make_room)
