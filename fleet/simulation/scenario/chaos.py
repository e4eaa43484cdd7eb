"""Faults drawn at random: everything that can break around robots, again and again."""

import numpy as np
from msgspec.structs import replace

from fleet.simulation.scenario.description import Scenario
from fleet.simulation.scenario.happenings import NEED_NOBODY, Fault, FaultKind

EVERY_S = 25.0
CALM_S = 60.0
"""At the end: what was broken must be able to come right."""
KINDS: tuple[tuple[FaultKind, float, float], ...] = (
    ("kill-agent", 1.0, 4.0),
    ("kill-service", 1.0, 5.0),
    ("kill-router", 1.0, 4.0),
    ("partition", 5.0, 25.0),
    ("slow-consumer", 5.0, 15.0),
    ("duplicate", 5.0, 20.0),
    ("reorder", 5.0, 20.0),
    ("corrupt", 5.0, 15.0),
    ("full-disk", 3.0, 12.0),
    ("power-cut-write", 0.0, 0.0),
)
"""With the least and longest duration. What changes the world itself, such as a robot carried away
or a clock set anew, is left to scenarios."""


def with_chaos(scenario: Scenario, seed: int) -> Scenario:
    """Its faults, and as many more as there is time for."""
    rng = np.random.default_rng(seed)
    faults, at_s = list(scenario.fault), float(rng.uniform(10.0, EVERY_S))
    while at_s < scenario.duration_s - CALM_S:
        faults.append(_fault(scenario, rng, at_s))
        at_s += float(rng.exponential(EVERY_S))
    return replace(scenario, fault=tuple(faults))


def _fault(scenario: Scenario, rng: np.random.Generator, at_s: float) -> Fault:
    kind, least_s, most_s = KINDS[int(rng.integers(len(KINDS)))]
    names = scenario.robot_names()
    target: str | None = names[int(rng.integers(len(names)))]
    if kind in NEED_NOBODY or (
        kind not in ("kill-agent", "power-cut-write") and rng.random() < 0.3
    ):
        target = None
    if kind == "full-disk":
        target = "service"
    for_s = round(float(rng.uniform(least_s, most_s)), 1)
    return Fault(at_s=round(at_s, 1), kind=kind, target=target, for_s=for_s)
