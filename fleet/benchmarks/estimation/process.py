"""One optimiser on one world in a process of its own, so that its peak memory can be told.

    python -m fleet.benchmarks.estimation '{"type": "Batch", "solver": "ours", "tags": 88, ...}'

prints one JSON object, an Outcome. A process has one thread if nothing else is said, and times are
processor time: what else runs on the machine hardly counts.
"""

import os
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from typing import Literal, TypeAlias, get_args

import msgspec

from fleet.benchmarks.suite import Plan
from tagmap.errors import DataError

Start: TypeAlias = Literal["noisy_truth", "dead_reckoning", "plain_alignment", "front_end"]
STARTS: tuple[Start, ...] = get_args(Start)
Solver: TypeAlias = Literal["ours", "gtsam"]
Updater: TypeAlias = Literal["ours", "isam2"]
Runs: TypeAlias = dict[str, list[float] | str]

ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA", "TBB")
}
NO_PEER = "gtsam is not installed: pip install 'tagmap[bench]'"
NO_MEMORY = "this system does not tell how much memory a process takes"
NOT_IN_SAMPLE = "not in a sample"


class Batch(msgspec.Struct, frozen=True, tag=True):
    """Solve one world `repeats` times from the same start.

    warm: whether a small world was solved before, so that compiled code is loaded. planned: whether
    a plan tells roughly where all tags are.
    """

    solver: Solver
    tags: int
    poses: int
    start: Start = "noisy_truth"
    repeats: int = 1
    warm: bool = True
    planned: bool = False
    threads: int = 1


class Updates(msgspec.Struct, frozen=True, tag=True):
    """Feed one world, of which a plan tells roughly where all tags are, as its robots drive."""

    updater: Updater
    tags: int
    poses: int
    poses_per_update: int


Task: TypeAlias = Batch | Updates


class Outcome(msgspec.Struct, frozen=True):
    """times_s: whole solves, or updates, first to last; import_s: until the first could begin;
    settle_s: what was done once after the last update. walls_s: whole solves by the wall clock.

    cost: sum of squared whitened residuals; None where a tag is left behind a camera that saw it.
    converged: whether the solver says so. peak_mb: by how much memory grew at most in the first
    solve, or in all updates, over the loaded problem; None where the system does not tell.
    """

    sightings: int
    import_s: float
    times_s: list[float]
    cost: float | None
    iterations: int
    converged: bool
    peak_mb: float | None
    settle_s: float = 0.0
    walls_s: list[float] = []


def solvers() -> tuple[Solver, ...]:
    """Those that are installed."""
    return ("ours", "gtsam") if find_spec("gtsam") else ("ours",)


def outcome(plan: Plan, task: Task) -> Outcome:
    """A sample is worked in this process: that saves the time to start, and spoils the memory."""
    plan.tell(f"estimation: {_in_words(task)}")
    if not plan.sample:
        return run(task)
    from fleet.benchmarks.estimation.work import work

    return work(task)


def _in_words(task: Task) -> str:
    if isinstance(task, Updates):
        return f"{task.updater}, {task.poses} poses, {task.poses_per_update} at a time"
    return f"{task.solver}, {task.poses} poses, {task.start}, threads: {task.threads}"


def run(task: Task, environment: Mapping[str, str] | None = None) -> Outcome:
    """In a new process. Raises DataError with its last words if it fails."""
    command = [sys.executable, "-m", __package__, msgspec.json.encode(task).decode()]
    env = {**os.environ, **ONE_THREAD, **(environment or {})}
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, env=env, check=False
    )
    if done.returncode:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise DataError(f"{task}: exit {done.returncode}: {' '.join(last)}")
    return msgspec.json.decode(done.stdout, type=Outcome)
