"""What a process does: it loads a world and a solver, solves, and tells."""

import math
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Protocol

from fleet.benchmarks.estimation.process import Batch, Outcome, Task, Updater, Updates

if TYPE_CHECKING:
    from fleet.benchmarks.estimation.world import World
    from tagmap.conventions import Index
    from tagmap.estimation.problem import Problem, State

TOLERANCE = 1e-6
"""Relative decrease of the cost at which a batch solver is done."""


class Batching(Protocol):
    """One problem, loaded. `solve` is the whole of what is timed, and may be called again."""

    @property
    def iterations(self) -> int: ...

    @property
    def converged(self) -> bool: ...

    def solve(self) -> None: ...

    def state(self) -> "State":
        """Where the last solve ended."""
        ...


class Updating(Protocol):
    """One problem of which nothing is known yet. `update` is what is timed."""

    def prepare(self, poses: "Index") -> None:
        """Make ready what the next update takes in: the factors that end at these poses."""
        ...

    def update(self) -> None: ...

    def settle(self) -> None:
        """Once, after all updates: bring up to date what they left behind."""
        ...

    def state(self) -> "State":
        """The best that is known after all updates."""
        ...


def work(task: Task) -> Outcome:
    """In this process."""
    return _batch(task) if isinstance(task, Batch) else _updates(task)


def _batch(task: Batch) -> Outcome:
    began_s = time.process_time()
    load = _batch_solver(task)
    import_s = time.process_time() - began_s
    from fleet.benchmarks.estimation.starts import start
    from fleet.benchmarks.estimation.world import WARM, Size, make, with_plan
    from fleet.benchmarks.memory import Growth

    if task.warm:
        small = make(WARM)
        load(small.problem, start(small, "noisy_truth"), TOLERANCE).solve()
    world = make(Size(task.tags, task.poses))
    if task.planned:
        world = with_plan(world)
    solver = load(world.problem, start(world, task.start), TOLERANCE)
    growth = Growth()
    times = [_times(solver.solve)]
    peak_mb = growth.peak_mb()
    times += [_times(solver.solve) for _ in range(task.repeats - 1)]
    return Outcome(
        sightings=world.problem.n_sightings,
        import_s=import_s,
        times_s=[processor_s for processor_s, _ in times],
        walls_s=[wall_s for _, wall_s in times],
        cost=_cost(world, solver.state()),
        iterations=solver.iterations,
        converged=solver.converged,
        peak_mb=peak_mb,
    )


def _updates(task: Updates) -> Outcome:
    began_s = time.process_time()
    load = _update_solver(task.updater)
    import_s = time.process_time() - began_s
    from fleet.benchmarks.estimation.starts import start
    from fleet.benchmarks.estimation.world import WARM, Size, as_driven, make, with_plan
    from fleet.benchmarks.memory import Growth

    for size in (WARM, Size(task.tags, task.poses)):
        world = with_plan(make(size))
        solver = load(world.problem, start(world, "noisy_truth"))
        growth = Growth()
        times_s = []
        for poses in as_driven(world, task.poses_per_update):
            solver.prepare(poses)
            times_s.append(_seconds(solver.update))
        settle_s = _seconds(solver.settle)
    peak_mb = growth.peak_mb()
    return Outcome(
        sightings=world.problem.n_sightings,
        import_s=import_s,
        times_s=times_s,
        cost=_cost(world, solver.state()),
        iterations=len(times_s),
        converged=True,
        peak_mb=peak_mb,
        settle_s=settle_s,
    )


def _batch_solver(task: Batch) -> "Callable[[Problem, State, float], Batching]":
    if task.solver == "ours":
        from fleet.benchmarks.estimation.ours import Ours

        return partial(Ours, threads=task.threads)
    from fleet.benchmarks.estimation.peer import LevenbergMarquardt

    return LevenbergMarquardt


def _update_solver(name: Updater) -> "Callable[[Problem, State], Updating]":
    if name == "ours":
        from fleet.benchmarks.estimation.living import Living

        return Living
    from fleet.benchmarks.estimation.isam import Isam2

    return Isam2


def _cost(world: "World", state: "State") -> float | None:
    from fleet.benchmarks.estimation.cost import cost

    found = cost(world.problem, state)
    return found if math.isfinite(found) else None


def _seconds(run: Callable[[], None]) -> float:
    return _times(run)[0]


def _times(run: Callable[[], None]) -> tuple[float, float]:
    """Processor time of all threads, and what the wall clock says, s."""
    began_s, saw_s = time.process_time(), time.perf_counter()
    run()
    return time.process_time() - began_s, time.perf_counter() - saw_s
