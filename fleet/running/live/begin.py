"""When a world in true time begins: once all programs should be there, on this machine, now."""

import os
import subprocess
import sys
import time

from fleet.simulation.scenario.description import Scenario
from fleet.simulation.world.build import build_world
from fleet.simulation.world.world import World

OTHERS = 2
"""Programs besides the agents."""
LOAD = (sys.executable, "-c", "import fleet.running.live.world")


def world_soon(scenario: Scenario, seed: int) -> World:
    """Built twice: to see how long it takes, while a program is loaded to see that, and to begin
    so much later. Raises ConfigError for what cannot be."""
    began_s = time.monotonic()
    with subprocess.Popen(LOAD) as loading:
        build_world(scenario, seed, 0)
        built_s = time.monotonic() - began_s
        loading.wait()
    loaded_s = time.monotonic() - began_s
    lead_s = lead(loaded_s, built_s, len(scenario.robot), _cores())
    return build_world(scenario, seed, time.time_ns() + round(1e9 * lead_s))


def lead(loaded_s: float, built_s: float, robots: int, cores: int) -> float:
    """In s: this world is built once more here, and in its own process; then all others start."""
    programs = robots + OTHERS
    others_s = loaded_s * programs / min(cores, programs)
    return built_s + loaded_s + built_s + others_s


def _cores() -> int:
    """Those that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
