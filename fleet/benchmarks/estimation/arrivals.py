"""Who arrives from where: four starts, judged by how far above the lowest cost each ends.

The lowest is that of any solver from any start at the same size. GTSAM at L takes minutes from
each start: it has only that of the noisy truth there, see ratios.
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
from fleet.benchmarks.estimation.ratios import SIZES, SMALL
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan

ARRIVED = 1e-4
CASES: dict[str, tuple[Solver, ...]] = {
    "S": ("ours", "gtsam"),
    "M": ("ours", "gtsam"),
    "L": ("ours",),
}
NOWHERE = "leaves tags behind cameras that saw them"

Ends: TypeAlias = dict[tuple[Solver, Start], Outcome]
Above: TypeAlias = dict[tuple[Solver, Start], float | None]


def measure(plan: Plan) -> Runs:
    runs: Runs = {}
    missed = 0
    for size in CASES:
        if plan.sample and size != "S":
            runs |= dict.fromkeys(_keys(size), NOT_IN_SAMPLE)
            continue
        above = _above_lowest(_ends(plan, size))
        runs |= dict.fromkeys(_keys(size), NO_PEER)
        for (solver, start), share in above.items():
            runs[f"{size}_{start}_{solver}_excess"] = NOWHERE if share is None else [share]
        missed += sum(
            _arrived(above, "gtsam", s) and not _arrived(above, "ours", s) for s in STARTS
        )
    return runs | {"starts_missed": [float(missed)] if "gtsam" in solvers() else NO_PEER}


def _ends(plan: Plan, size: str) -> Ends:
    tags, poses = (SMALL if plan.sample else SIZES)[size]
    return {
        (solver, start): outcome(plan, Batch(solver, tags, poses, start))
        for solver, start in product(CASES[size], STARTS)
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
    return [f"{size}_{start}_{solver}_excess" for solver, start in product(CASES[size], STARTS)]


METRICS = (
    Metric("starts_missed", "1", "lower", "from which GTSAM arrives and we do not", reach=0.0),
    *(Metric(key, "1", "lower", "cost above the lowest") for size in CASES for key in _keys(size)),
)
