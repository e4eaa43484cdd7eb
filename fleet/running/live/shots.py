"""What agents' logs say of their shots."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

if TYPE_CHECKING:
    from fleet.evaluation.scores.evidence import ShotNote
    from fleet.simulation.world.world import World

EVENT = "shot "


def shots(world: "World", robot: str, log: Path) -> "Iterator[ShotNote]":
    """In order; times are by the clock of the world."""
    from fleet.evaluation.scores.evidence import ShotNote

    for event in events(log):
        name, t_ns = event.get("event"), event.get("t_ns")
        if isinstance(name, str) and name.startswith(EVENT) and isinstance(t_ns, int):
            kind = name.removeprefix(EVENT)
            world_ns = world.robots[robot].world_ns(t_ns)
            yield ShotNote(robot, world_ns, kind, int(event["shots"]), event["tag"])


def events(log: Path) -> Iterator[dict[str, Any]]:
    """Lines that are JSON objects: not tracebacks, nor what a killed process left of a line."""
    if not log.exists():
        return
    with log.open("rb") as lines:
        for line in lines:
            try:
                yield msgspec.json.decode(line, type=dict[str, Any])
            except msgspec.DecodeError:
                continue
