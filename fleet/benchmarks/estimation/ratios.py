"""Whole solves from noisy truth beside GTSAM's Levenberg-Marquardt: time, cost, memory."""

from statistics import median

from fleet.benchmarks.estimation.process import (
    NO_MEMORY,
    NO_PEER,
    Batch,
    Outcome,
    Runs,
    Solver,
    outcome,
    solvers,
)
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan

SIZES = {"S": (88, 2_000), "M": (489, 20_000), "L": (1_999, 100_000)}
"""Tags and poses."""
SMALL = {"S": (40, 500), "M": (60, 1_000), "L": (88, 2_000)}
"""The same in a sample."""
ROUNDS = {"S": 5, "M": 5, "L": 1}
REPEATS: dict[Solver, dict[str, int]] = {
    "ours": {"S": 9, "M": 5, "L": 5},
    "gtsam": {"S": 5, "M": 1, "L": 1},
}
REACH = {"S": 15.0, "M": 15.0, "L": 35.0}
REACH_MB = {"L": 400.0}
EQUAL = 1e-6
"""A cost may lie so much above another, as a share, and still count as equal."""


def measure(plan: Plan) -> Runs:
    runs: Runs = {}
    for size in SIZES:
        runs |= _compared(_rounds(plan, size), size)
    return runs


def _rounds(plan: Plan, size: str) -> dict[Solver, list[Outcome]]:
    """In every round each solver has one process, in which it solves several times."""
    tags, poses = (SMALL if plan.sample else SIZES)[size]
    found: dict[Solver, list[Outcome]] = {"ours": [], "gtsam": []}
    for _ in range(1 if plan.sample else ROUNDS[size]):
        for solver in solvers():
            repeats = 1 if plan.sample else REPEATS[solver][size]
            found[solver].append(outcome(plan, Batch(solver, tags, poses, repeats=repeats)))
    return found


def _compared(found: dict[Solver, list[Outcome]], size: str) -> Runs:
    runs: Runs = {}
    for solver, own in found.items():
        runs[f"{size}_{solver}_s"] = [median(o.times_s) for o in own] or NO_PEER
        peaks = [o.peak_mb for o in own if o.peak_mb is not None]
        runs[f"{size}_{solver}_mb"] = peaks or (NO_MEMORY if own else NO_PEER)
    pairs = list(zip(found["ours"], found["gtsam"], strict=False))
    runs[f"{size}_ratio"] = [median(b.times_s) / median(a.times_s) for a, b in pairs] or NO_PEER
    runs[f"{size}_excess"] = [
        a.cost / b.cost - 1.0 for a, b in pairs if a.cost is not None and b.cost is not None
    ] or NO_PEER
    return runs


def _of_size(size: str) -> tuple[Metric, ...]:
    name, mb = f"{size}_ratio", REACH_MB.get(size)
    return (
        Metric(name, "x", "higher", "GTSAM's time by ours", tolerance=0.3, reach=REACH[size]),
        Metric(f"{size}_excess", "1", "lower", "our cost by GTSAM's, less 1", reach=EQUAL),
        Metric(f"{size}_ours_s", "s", "lower", "our whole solve"),
        Metric(f"{size}_gtsam_s", "s", "lower", "GTSAM's"),
        Metric(f"{size}_ours_mb", "MB", "lower", "our memory over the problem", reach=mb),
        Metric(f"{size}_gtsam_mb", "MB", "lower", "GTSAM's over the graph"),
    )


METRICS = tuple(metric for size in SIZES for metric in _of_size(size))
