"""What `fleet run --live` and `fleet demo` do until there is something to judge."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from fleet.evaluation.scores.evidence import Evidence
    from fleet.simulation.scenario.description import Scenario


def played_live(
    scenario: "Scenario", seed: int, folder: Path, stopped: Callable[[], bool]
) -> "Evidence":
    """Raises TagmapError."""
    from fleet.running import kernels
    from fleet.running.live.begin import world_soon
    from fleet.running.live.faults import without_virtual
    from fleet.running.live.play import play_live
    from fleet.running.live.site import DB
    from fleet.running.progress import Clocked, so_far

    scenario, left = without_virtual(scenario)
    for fault in left:
        _tell(f"{fault.kind} at {fault.at_s:g} s is left out: it can be in virtual time only")
    kernels.prepare(_tell, stopped)
    world = world_soon(scenario, seed)
    with Clocked(world.start_ns, world.end_ns, _tell, about=lambda: so_far(folder / DB)) as clocked:
        return play_live(world, folder, clocked.show, clocked.say, stopped)


def _tell(line: str) -> None:
    click.echo(line, err=True)
