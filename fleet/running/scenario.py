"""A scenario played in virtual time, recorded and judged."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fleet.running.tape import Tape
from fleet.virtual.dark_room import dark_room
from fleet.virtual.run import SITE, Played, play

if TYPE_CHECKING:
    from fleet.evaluation.scores.evidence import Evidence, ShotNote
    from fleet.simulation.world.world import World

TAPE, LOG = "wire.tape", "log.jsonl"
START_NS = 1_767_225_600_000_000_000
"""When every world begins: the same run gives the same bytes."""


def play_scenario(
    world: "World",
    folder: Path,
    tell: Callable[[int], None],
    stopped: Callable[[], bool],
) -> "Evidence":
    """Everything of the run is in `folder` afterwards. Raises TagmapError."""
    from fleet.evaluation.scores.evidence import Evidence

    began_s = time.monotonic()
    with dark_room(world) as room, Tape(folder / TAPE) as tape, _logged(folder / LOG):
        played = play(world, folder, tape.hear, tell, stopped, room)
    return Evidence(
        world=world,
        db=played.db,
        tape=folder / TAPE,
        site=SITE,
        shots=tuple(_shots(world, played)),
        sent=sum(summary.keyframes for summary in played.summaries.values()),
        wall_s=time.monotonic() - began_s,
    )


@contextmanager
def _logged(path: Path) -> Iterator[None]:
    """What agents and service log goes there, in the order of virtual time."""
    import structlog

    with path.open("w") as file:
        structlog.configure(
            processors=[
                structlog.processors.add_log_level,
                structlog.processors.format_exc_info,
                structlog.processors.JSONRenderer(),
            ],
            logger_factory=structlog.PrintLoggerFactory(file),
            cache_logger_on_first_use=False,
        )
        try:
            yield
        finally:
            structlog.reset_defaults()


def _shots(world: "World", played: Played) -> Iterator["ShotNote"]:
    from fleet.evaluation.scores.evidence import ShotNote

    for name, reports in played.reports.items():
        for report in reports:
            t_ns = world.robots[name].world_ns(report.pose.t_ns)
            for outcome in report.outcomes:
                verdict = outcome.verdict
                yield ShotNote(name, t_ns, verdict.kind, verdict.shots, verdict.tag)
