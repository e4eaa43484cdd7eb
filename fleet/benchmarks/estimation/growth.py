"""Time and memory as robots drive on below the same ceiling: ten thousand poses to a million."""

import math

from fleet.benchmarks.estimation.process import NO_MEMORY, Batch, Outcome, Runs, outcome
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan

TAGS, POSES = 489, {"10k": 10_000, "30k": 30_000, "100k": 100_000, "300k": 300_000, "1M": 1_000_000}
SMALL = {"10k": 500, "30k": 1_000, "100k": 2_000, "300k": 4_000, "1M": 6_000}
SMALL_TAGS = 40
"""The same in a sample."""
REPEATS = {"10k": 5, "30k": 5, "100k": 3, "300k": 3, "1M": 2}
EXPONENT = 1.1


def measure(plan: Plan) -> Runs:
    poses, tags = (SMALL, SMALL_TAGS) if plan.sample else (POSES, TAGS)
    found = {
        name: outcome(plan, Batch("ours", tags, n, repeats=1 if plan.sample else REPEATS[name]))
        for name, n in poses.items()
    }
    return _as_runs(found)


def _as_runs(found: dict[str, Outcome]) -> Runs:
    runs: Runs = {}
    times, peaks = [], []
    for name, o in found.items():
        times.append((o.sightings, min(o.times_s)))
        runs[f"growth_{name}_s"] = o.times_s
        if o.peak_mb is None:
            runs[f"growth_{name}_mb"] = NO_MEMORY
        else:
            runs[f"growth_{name}_mb"] = [o.peak_mb]
            peaks.append((o.sightings, o.peak_mb))
    runs["growth_time_exponent"] = [exponent(times)]
    runs["growth_memory_exponent"] = [exponent(peaks)] if peaks else NO_MEMORY
    return runs


def exponent(points: list[tuple[int, float]]) -> float:
    """k of y ~ x^k, least squares on logarithms."""
    logs = [(math.log(x), math.log(y)) for x, y in points]
    mean_x = sum(x for x, _ in logs) / len(logs)
    mean_y = sum(y for _, y in logs) / len(logs)
    across = sum((x - mean_x) * (y - mean_y) for x, y in logs)
    return across / sum((x - mean_x) ** 2 for x, _ in logs)


METRICS = (
    Metric("growth_time_exponent", "1", "lower", "k of time ~ sightings^k", reach=EXPONENT),
    Metric("growth_memory_exponent", "1", "lower", "of our memory", reach=EXPONENT),
    *(Metric(f"growth_{n}_s", "s", "lower", f"{n} poses, {TAGS} tags") for n in POSES),
    *(Metric(f"growth_{n}_mb", "MB", "lower", "our memory over the problem") for n in POSES),
)
