"""The joint optimisation beside GTSAM, on the same problems and the same cost."""

from fleet.benchmarks.estimation import arrivals, growth, ratios, threads, updating, waiting
from fleet.benchmarks.estimation.process import Runs
from fleet.benchmarks.suite import Plan, Suite

PARTS = (ratios, threads, arrivals, growth, waiting, updating)


def measure(plan: Plan) -> Runs:
    runs: Runs = {}
    for part in PARTS:
        runs |= part.measure(plan)
    return runs


METRICS = tuple(metric for part in PARTS for metric in part.METRICS)
SUITE = Suite("estimation", "the joint optimisation beside GTSAM", METRICS, measure)
