"""New keyframes as robots drive, POSES_PER_UPDATE at a time: iSAM2 beside the batch optimum.

Another incremental solver is one more Updater: a class with the methods of work.Updating.
"""

from fleet.benchmarks.estimation.process import NO_PEER, Batch, Runs, Updates, outcome, solvers
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan

SIZE, SMALL = (489, 20_000), (40, 500)
POSES_PER_UPDATE = 100


def measure(plan: Plan) -> Runs:
    """The batch solver is given the same factors."""
    if "gtsam" not in solvers():
        return {metric.key: NO_PEER for metric in METRICS}
    tags, poses = SMALL if plan.sample else SIZE
    found = outcome(plan, Updates("isam2", tags, poses, POSES_PER_UPDATE))
    whole = outcome(plan, Batch("ours", tags, poses, planned=True))
    assert found.cost is not None
    assert whole.cost is not None
    return {
        "isam2_update_s": found.times_s,
        "isam2_total_s": [sum(found.times_s)],
        "isam2_excess": [found.cost / whole.cost - 1.0],
    }


METRICS = (
    Metric("isam2_update_s", "s", "lower", f"iSAM2, {POSES_PER_UPDATE} poses more"),
    Metric("isam2_total_s", "s", "lower", "all its updates"),
    Metric("isam2_excess", "1", "lower", "its last cost by the batch optimum, less 1"),
)
