"""The joint optimisation beside GTSAM, on the same cost, each solve in a process of its own."""

from importlib.util import find_spec
from statistics import median
from typing import TypeAlias

from fleet.benchmarks.estimation.process import Name, Outcome, Task, run, work
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

Runs: TypeAlias = dict[str, list[float] | str]

SIZES = {"S": (88, 2_000), "M": (489, 20_000), "L": (1_999, 100_000)}
"""Tags and poses."""
SMALL = {"S": (40, 500), "M": (60, 1_000), "L": (88, 2_000)}
"""The same for a sample."""
ROUNDS = {"S": 5, "M": 5, "L": 1}
REPEATS: dict[Name, dict[str, int]] = {
    "ours": {"S": 9, "M": 5, "L": 5},
    "gtsam": {"S": 5, "M": 1, "L": 1},
}
REACH = {"S": 15.0, "M": 15.0, "L": 35.0}
AS_GOOD = 1e-6
"""A cost may lie so much above another, as a share, and still count as equal."""
NO_PEER = "gtsam is not installed: pip install 'tagmap[bench]'"


def measure(plan: Plan) -> Runs:
    runs: Runs = {}
    for size in SIZES:
        runs |= _side_by_side(plan, size)
    return runs


def _solve(plan: Plan, task: Task) -> Outcome:
    """A sample runs in this process: that saves the time to start, and spoils only the memory."""
    plan.tell(f"estimation: {task.solver}, {task.poses} poses, {task.start}")
    return work(task) if plan.sample else run(task)


def _side_by_side(plan: Plan, size: str) -> Runs:
    """In every round each solver has one process, which solves several times."""
    keys = ("ratio", "excess", "ours_s", "gtsam_s", "ours_mb", "gtsam_mb")
    runs: dict[str, list[float]] = {f"{size}_{key}": [] for key in keys}
    tags, poses = (SMALL if plan.sample else SIZES)[size]
    for _ in range(1 if plan.sample else ROUNDS[size]):
        found: dict[Name, Outcome] = {}
        for name in _solvers():
            repeats = 1 if plan.sample else REPEATS[name][size]
            found[name] = _solve(plan, Task(name, tags, poses, repeats=repeats))
            runs[f"{size}_{name}_s"].append(median(found[name].times_s))
            runs[f"{size}_{name}_mb"].append(found[name].peak_mb)
        if "gtsam" in found:
            runs[f"{size}_ratio"].append(_seconds(found["gtsam"]) / _seconds(found["ours"]))
            runs[f"{size}_excess"].append(found["ours"].cost / found["gtsam"].cost - 1.0)
    return {key: values or NO_PEER for key, values in runs.items()}


def _seconds(found: Outcome) -> float:
    return median(found.times_s)


def _solvers() -> tuple[Name, ...]:
    return ("ours", "gtsam") if find_spec("gtsam") else ("ours",)


def _of_size(size: str) -> tuple[Metric, ...]:
    return (
        Metric(
            f"{size}_ratio", "x", "higher", "GTSAM's time by ours", tolerance=0.3, reach=REACH[size]
        ),
        Metric(f"{size}_excess", "1", "lower", "our cost by GTSAM's, - 1", reach=AS_GOOD),
        Metric(f"{size}_ours_s", "s", "lower", "our whole solve"),
        Metric(f"{size}_gtsam_s", "s", "lower", "GTSAM's Levenberg-Marquardt"),
        Metric(
            f"{size}_ours_mb",
            "MB",
            "lower",
            "our peak memory over the problem",
            reach=400.0 if size == "L" else None,
        ),
        Metric(f"{size}_gtsam_mb", "MB", "lower", "GTSAM's over the graph"),
    )


METRICS = tuple(metric for size in SIZES for metric in _of_size(size))
SUITE = Suite("estimation", "the joint optimisation beside GTSAM", METRICS, measure)
