"""The faults of a scenario as what they do to the fleet in virtual time."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from fleet.simulation.scenario.happenings import Fault, FaultKind
from fleet.simulation.world.world import World
from fleet.virtual.site import SERVICE, FullDisk, Kill
from fleet.virtual.weather import Spell, Weather

DOWN_S = {"kill-agent": 2.0, "kill-service": 2.0, "kill-router": 1.5}
LASTING_S = 10.0
"""Of a fault that does not say how long it lasts."""
WEATHER: dict[FaultKind, Weather] = {
    "slow-consumer": Weather(per_s=20.0, queue=64),
    "duplicate": Weather(doubled=0.3),
    "reorder": Weather(late=0.3),
    "corrupt": Weather(torn=0.1),
}
WORDS_WRITTEN = 5
"""Of a record, when the power of its tag is cut."""


@dataclass(slots=True)
class Plan:
    """cuts: participant, from, until (None: for good). acts: what to do to the world, and when."""

    agents: dict[str, list[Kill]] = field(default_factory=dict)
    service: list[Kill] = field(default_factory=list)
    full: list[FullDisk] = field(default_factory=list)
    cuts: list[tuple[str, int, int | None]] = field(default_factory=list)
    spells: dict[str, list[Spell]] = field(default_factory=dict)
    acts: list[tuple[int, Callable[[], None]]] = field(default_factory=list)


def planned(world: World, faults: Iterable[Fault]) -> Plan:
    """Clock jumps and batteries are part of the world's robots already."""
    plan = Plan()
    ordered = sorted(faults, key=lambda fault: fault.at_s)
    for fault in ordered:
        _plan(plan, world, fault, ordered)
    return plan


def _plan(plan: Plan, world: World, fault: Fault, all_of: list[Fault]) -> None:
    at_ns = world.start_ns + _ns(fault.at_s)
    until_ns = at_ns + _ns(fault.for_s or LASTING_S)
    whom = [*world.robots, SERVICE] if fault.target is None else [fault.target]
    if fault.kind == "kill-agent":
        plan.agents.setdefault(whom[0], []).append(_kill(at_ns, fault))
    elif fault.kind == "kill-service":
        plan.service.append(_kill(at_ns, fault))
    elif fault.kind == "kill-router":
        back_ns = at_ns + _ns(fault.for_s or DOWN_S["kill-router"])
        plan.cuts += [(name, at_ns, back_ns) for name in (*world.robots, SERVICE)]
    elif fault.kind == "partition":
        plan.cuts += [(name, at_ns, healed_ns(world, name, fault, all_of)) for name in whom]
    elif fault.kind == "full-disk":
        plan.full.append(FullDisk(at_ns, until_ns))
    elif fault.kind == "power-cut-write":
        plan.acts.append((at_ns, lambda: cut_power(world)))
    elif fault.kind in WEATHER:
        spell = Spell(at_ns, until_ns, WEATHER[fault.kind])
        for name in whom:
            plan.spells.setdefault(name, []).append(spell)


def _kill(at_ns: int, fault: Fault) -> Kill:
    return Kill(at_ns, fault.for_s or DOWN_S[fault.kind])


def healed_ns(world: World, name: str, fault: Fault, all_of: list[Fault]) -> int | None:
    """When it says so, else at the next `heal` for it, else never."""
    if fault.for_s:
        return world.start_ns + _ns(fault.at_s + fault.for_s)
    heals = [
        one.at_s
        for one in all_of
        if one.kind == "heal" and one.at_s >= fault.at_s and one.target in (None, name)
    ]
    return world.start_ns + _ns(min(heals)) if heals else None


def cut_power(world: World) -> None:
    """Of each tag, in the middle of the record that is written to it next."""
    with world.scene.lock:
        for tag in world.scene.tags:
            tag.faults.power_fails_after = [WORDS_WRITTEN]


def _ns(seconds: float) -> int:
    return round(1e9 * seconds)
