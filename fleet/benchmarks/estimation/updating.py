"""New keyframes as robots drive: ours and iSAM2, POSES_PER_UPDATE at a time, beside the batch.

Another incremental solver is one more Updater: a class with the methods of work.Updating.
"""

from statistics import median

from fleet.benchmarks.estimation.process import (
    NO_PEER,
    Batch,
    Outcome,
    Runs,
    Updates,
    outcome,
    solvers,
)
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan

SIZE, SMALL = (489, 20_000), (40, 500)
POSES_PER_UPDATE = 100
REACH, REACH_EXCESS = 15.0, 5e-4


def measure(plan: Plan) -> Runs:
    """All are given the same factors and start values."""
    tags, poses = SMALL if plan.sample else SIZE
    whole = outcome(plan, Batch("ours", tags, poses, planned=True))
    found = outcome(plan, Updates("ours", tags, poses, POSES_PER_UPDATE))
    tenth = max(1, len(found.times_s) // 10)
    runs: Runs = {
        "lifelong_update_s": found.times_s,
        "lifelong_total_s": [sum(found.times_s)],
        "lifelong_settle_s": [found.settle_s],
        "lifelong_growth": [median(found.times_s[-tenth:]) / median(found.times_s[:tenth])],
        "lifelong_excess": [_excess(found, whole)],
    }
    if "gtsam" not in solvers():
        return runs | {metric.key: NO_PEER for metric in BESIDE}
    peer = outcome(plan, Updates("isam2", tags, poses, POSES_PER_UPDATE))
    return runs | {
        "lifelong_ratio": [median(peer.times_s) / median(found.times_s)],
        "lifelong_total_ratio": [sum(peer.times_s) / sum(found.times_s)],
        "isam2_update_s": peer.times_s,
        "isam2_total_s": [sum(peer.times_s)],
        "isam2_excess": [_excess(peer, whole)],
    }


def _excess(found: Outcome, whole: Outcome) -> float:
    assert found.cost is not None
    assert whole.cost is not None
    return found.cost / whole.cost - 1.0


BESIDE = (
    Metric("lifelong_ratio", "x", "higher", "iSAM2's update by ours", tolerance=0.3, reach=REACH),
    Metric("lifelong_total_ratio", "x", "higher", "all of iSAM2's updates by ours"),
    Metric("isam2_update_s", "s", "lower", f"iSAM2, {POSES_PER_UPDATE} poses more"),
    Metric("isam2_total_s", "s", "lower", "all its updates"),
    Metric("isam2_excess", "1", "lower", "its last cost by the batch optimum, less 1"),
)
METRICS = (
    *BESIDE,
    Metric("lifelong_excess", "1", "lower", "last cost by the batch's, less 1", reach=REACH_EXCESS),
    Metric("lifelong_growth", "1", "lower", "last tenth of our updates by the first", reach=1.0),
    Metric("lifelong_update_s", "s", "lower", f"ours, {POSES_PER_UPDATE} poses more"),
    Metric("lifelong_total_s", "s", "lower", "all our updates"),
    Metric("lifelong_settle_s", "s", "lower", "then, once: old poses follow"),
)
