"""When a world in true time begins: once all programs should be there, on this machine, now."""

import os
import time

from fleet.simulation.scenario.description import Scenario
from fleet.simulation.world.build import build_world
from fleet.simulation.world.world import World

MARGIN, WORLD, PROGRAM = 0.8, 1.2, 0.9
"""World and programs need so many times the time that it took this process to come this far."""
OTHERS = 2
"""Programs besides the agents."""


def world_soon(scenario: Scenario, seed: int) -> World:
    """Raises ConfigError for what cannot be."""
    began_s, worked_s = time.monotonic(), time.process_time()
    build_world(scenario, seed, 0)
    busy = (time.monotonic() - began_s) / max(time.process_time() - worked_s, 1e-3)
    lead_s = lead(time.process_time(), max(1.0, busy), len(scenario.robot), _cores())
    return build_world(scenario, seed, time.time_ns() + round(1e9 * lead_s))


def lead(took_s: float, busy: float, robots: int, cores: int) -> float:
    """took_s: of a processor, to start one program; busy: how many times longer that took. In s."""
    programs = PROGRAM * (robots + OTHERS) / min(cores, robots + OTHERS)
    return MARGIN * busy * took_s * (WORLD + programs)


def _cores() -> int:
    """Those that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
