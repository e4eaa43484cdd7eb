"""What the world's process is told: a file that it is built from, so that both sides have the same
world; and the names of what it leaves."""

from pathlib import Path

import msgspec

from fleet.simulation.scenario.description import Scenario
from fleet.simulation.world.build import build_world
from fleet.simulation.world.world import World

PLAN, MEMORIES = "world.json", "memories.json"


class WorldPlan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    scenario: Scenario
    seed: int
    start_ns: int
    site: str
    site_number: int

    def build(self) -> World:
        """Bit for bit the same in every process."""
        return build_world(self.scenario, self.seed, self.start_ns)


def write_plan(plan: WorldPlan, folder: Path) -> Path:
    path = folder / PLAN
    path.write_bytes(msgspec.json.format(msgspec.json.encode(plan)) + b"\n")
    return path


def read_plan(path: Path) -> WorldPlan:
    return msgspec.json.decode(path.read_bytes(), type=WorldPlan)
