"""One optimiser on one world in a process of its own, so that its peak memory can be told.

    python -m fleet.benchmarks.estimation_process '{"solver": "ours", "tags": 88, ...}'

prints one JSON object, an Outcome. A process has one thread, and times are processor time: what
else runs on the machine hardly counts.
"""

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias, get_args

import msgspec

from tagmap.errors import DataError

if TYPE_CHECKING:
    from tagmap.estimation.problem import State

Name: TypeAlias = Literal["ours", "gtsam"]
Start: TypeAlias = Literal["noisy_truth", "dead_reckoning", "plain_alignment", "front_end"]
STARTS: tuple[Start, ...] = get_args(Start)

TOLERANCE = 1e-6
"""Relative decrease of the cost at which both are done."""
ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA", "TBB")
}


class Solver(Protocol):
    """One problem, loaded. `solve` is the whole of what is timed, and may be called again."""

    @property
    def iterations(self) -> int: ...

    @property
    def converged(self) -> bool: ...

    def solve(self) -> None: ...

    def state(self) -> "State":
        """Where the last solve ended."""
        ...


class Task(msgspec.Struct, frozen=True):
    """Solve one world `repeats` times from the same start.

    warm: whether a small world was solved before, so that compiled code is loaded.
    """

    solver: Name
    tags: int
    poses: int
    start: Start = "noisy_truth"
    repeats: int = 1
    warm: bool = True


class Outcome(msgspec.Struct, frozen=True):
    """times_s: whole solves, first to last; import_s: until the solver could be called.

    cost: sum of squared whitened residuals; None where a tag is left behind a camera that saw it.
    converged: whether the solver says so. peak_mb: by how much memory grew at most in the first
    solve, over the loaded problem; None where the system does not tell.
    """

    sightings: int
    import_s: float
    times_s: list[float]
    cost: float | None
    iterations: int
    converged: bool
    peak_mb: float | None


def run(task: Task, environment: Mapping[str, str] | None = None) -> Outcome:
    """In a new process. Raises DataError with its last words if it fails."""
    command = [sys.executable, "-m", __name__, msgspec.json.encode(task).decode()]
    env = os.environ | ONE_THREAD | (environment or {})
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, env=env, check=False
    )
    if done.returncode:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise DataError(f"{task}: exit {done.returncode}: {' '.join(last)}")
    return msgspec.json.decode(done.stdout, type=Outcome)


def work(task: Task) -> Outcome:
    """In this process."""
    began_s = time.process_time()
    load = import_module(f"fleet.benchmarks.estimation_{task.solver}").load
    import_s = time.process_time() - began_s
    from fleet.benchmarks.estimation_cost import cost
    from fleet.benchmarks.estimation_starts import start
    from fleet.benchmarks.estimation_world import SIZES, Size, make
    from fleet.benchmarks.memory import Growth

    if task.warm:
        small = make(SIZES["XS"])
        load(small.problem, start(small, "noisy_truth"), TOLERANCE).solve()
    world = make(Size(task.tags, task.poses))
    solver: Solver = load(world.problem, start(world, task.start), TOLERANCE)
    growth = Growth()
    first_s = _seconds(solver.solve)
    peak_mb = growth.peak_mb()
    found = cost(world.problem, solver.state())
    return Outcome(
        sightings=world.problem.n_sightings,
        import_s=import_s,
        times_s=[first_s, *(_seconds(solver.solve) for _ in range(task.repeats - 1))],
        cost=found if math.isfinite(found) else None,
        iterations=solver.iterations,
        converged=solver.converged,
        peak_mb=peak_mb,
    )


def _seconds(run: Callable[[], None]) -> float:
    began_s = time.process_time()
    run()
    return time.process_time() - began_s


if __name__ == "__main__":
    sys.stdout.buffer.write(msgspec.json.encode(work(msgspec.json.decode(sys.argv[1], type=Task))))
