"""Play a recording through real processes until the final map is there."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fleet.replay.recording import Recording, write_journals
from fleet.running.final_map import solve_finally
from fleet.running.progress import Progress, counts
from fleet.running.results import Results, read_results
from fleet.running.supervisor import PAUSE_S, SitePlan, Supervisor, playing
from tagmap.errors import DataError

SITE = "site"


@dataclass(frozen=True, slots=True)
class Run:
    """`keyframes_sent`: appended to the agents' outboxes; all are settled when a run ends."""

    results: Results
    keyframes_sent: int
    wall_s: float
    db: Path


def run_recording(
    recording: Recording,
    folder: Path,
    db: Path,
    pace: tuple[str, ...],
    survey: Path | None,
    tell: Callable[[str], None],
) -> Run:
    """One agent per robot of `recording`, at `pace` (arguments of `robot-agent run`).

    `folder` takes journals, outboxes and logs; `db` is new. Raises TagmapError.
    """
    began_s = time.monotonic()
    folder = folder.absolute()  # the programs run in it
    journals = write_journals(recording, folder)
    agents = [playing(r.robot, r.number, journals[r.robot], pace) for r in recording.robots]
    plan = SitePlan(SITE, folder, db.absolute(), agents, survey and survey.absolute())
    total = sum(len(robot.observations) for robot in recording.robots)
    supervisor = Supervisor(plan, tell)
    try:
        supervisor.start()
        with Progress(total, lambda: counts(plan.db), tell) as progress:
            while not supervisor.finished:
                supervisor.tend()
                progress.show()
                time.sleep(PAUSE_S)
            progress.stage("solving the final map")
            solve_finally(supervisor, plan.site, progress.show)
        sent = sum(summary.keyframes for summary in supervisor.summaries())
    finally:
        supervisor.stop()
    return Run(read_results(plan.db, recording.kind), sent, time.monotonic() - began_s, plan.db)


def require_new(db: Path) -> None:
    """Keyframes of another run would be counted and solved together with those of this one."""
    if db.exists() and db.stat().st_size:
        raise DataError(f"{db}: exists already; a replay starts with an empty database")
    if not db.absolute().parent.is_dir():
        raise DataError(f"{db}: its folder does not exist")
