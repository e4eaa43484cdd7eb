"""Who arrives from where: four starts, judged by how far above the lowest cost each ends.

The lowest is that of any solver from any start at the same size.
"""

from itertools import product
from typing import TypeAlias

from fleet.benchmarks.estimation.process import (
    NO_PEER,
    NOT_IN_SAMPLE,
    STARTS,
    Batch,
    Outcome,
    Runs,
    Solver,
    Start,
    outcome,
    solvers,
)
from fleet.benchmarks.estimation.ratios import EQUAL, SIZES, SMALL
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan

ARRIVED = EQUAL
BOTH: tuple[Solver, ...] = ("ours", "gtsam")
NOWHERE = "leaves tags behind cameras that saw them"
NOT_BOTH = "one of the two does not arrive"

Ends: TypeAlias = dict[tuple[Solver, Start], Outcome]
Above: TypeAlias = dict[tuple[Solver, Start], float | None]


def measure(plan: Plan) -> Runs:
    runs: Runs = {}
    missed = 0
    for size in SIZES:
        if plan.sample and size != "S":
            runs |= dict.fromkeys(_keys(size), NOT_IN_SAMPLE)
            continue
        ends = _ends(plan, size)
        above = _above_lowest(ends)
        runs |= dict.fromkeys(_keys(size), NO_PEER) | _of_size(size, ends, above)
        missed += sum(
            _arrived(above, "gtsam", s) and not _arrived(above, "ours", s) for s in STARTS
        )
    return runs | {"starts_missed": [float(missed)] if "gtsam" in solvers() else NO_PEER}


def _of_size(size: str, ends: Ends, above: Above) -> Runs:
    runs: Runs = {}
    for (solver, start), share in above.items():
        runs[f"{size}_{start}_{solver}_excess"] = NOWHERE if share is None else [share]
    for solver in solvers():
        runs[f"{size}_{solver}_arrivals"] = [float(sum(_arrived(above, solver, s) for s in STARTS))]
    for start in STARTS if "gtsam" in solvers() else ():
        times = [sum(ends[solver, start].times_s) for solver in ("gtsam", "ours")]
        both = all(_arrived(above, solver, start) for solver in BOTH)
        runs[f"{size}_{start}_ratio"] = [times[0] / times[1]] if both else NOT_BOTH
    return runs


def _ends(plan: Plan, size: str) -> Ends:
    tags, poses = (SMALL if plan.sample else SIZES)[size]
    return {
        (solver, start): outcome(plan, Batch(solver, tags, poses, start))
        for solver, start in product(BOTH, STARTS)
        if solver in solvers()
    }


def _above_lowest(ends: Ends) -> Above:
    """As a share; None where the cost is infinite."""
    lowest = min(end.cost for end in ends.values() if end.cost is not None)
    return {key: None if end.cost is None else end.cost / lowest - 1.0 for key, end in ends.items()}


def _arrived(above: Above, solver: Solver, start: Start) -> bool:
    share = above.get((solver, start))
    return share is not None and share <= ARRIVED


def _keys(size: str) -> list[str]:
    return [metric.key for metric in METRICS if metric.key.startswith(f"{size}_")]


def _metrics(size: str) -> tuple[Metric, ...]:
    return (
        *(Metric(f"{size}_{solver}_arrivals", "1", "higher", "starts of four") for solver in BOTH),
        *(
            Metric(f"{size}_{start}_{solver}_excess", "1", "lower", "cost above the lowest")
            for solver, start in product(BOTH, STARTS)
        ),
        *(
            Metric(f"{size}_{start}_ratio", "x", "higher", "GTSAM's time by ours")
            for start in STARTS
        ),
    )


METRICS = (
    Metric("starts_missed", "1", "lower", "from which GTSAM arrives and we do not", reach=0.0),
    *(metric for size in SIZES for metric in _metrics(size)),
)
