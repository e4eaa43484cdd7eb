"""What a second thread is good for, by the wall clock: other work on the machine counts."""

from statistics import median

from fleet.benchmarks.estimation.process import NOT_IN_SAMPLE, Batch, Runs, outcome
from fleet.benchmarks.estimation.ratios import SIZES
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan

MEASURED = ("M", "L")
ROUNDS, REPEATS = 3, 5


def measure(plan: Plan) -> Runs:
    if plan.sample:
        return {metric.key: NOT_IN_SAMPLE for metric in METRICS}
    return {f"{size}_two_threads": [_gain(plan, size) for _ in range(ROUNDS)] for size in MEASURED}


def _gain(plan: Plan, size: str) -> float:
    tags, poses = SIZES[size]
    one, two = (
        outcome(plan, Batch("ours", tags, poses, repeats=REPEATS, threads=threads))
        for threads in (1, 2)
    )
    return median(one.walls_s) / median(two.walls_s)


METRICS = tuple(
    Metric(f"{size}_two_threads", "x", "higher", "our time with one thread by that with two")
    for size in MEASURED
)
