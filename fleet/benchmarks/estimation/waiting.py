"""What the first solve in a process costs besides solving: importing and loading compiled code."""

from tempfile import TemporaryDirectory

from fleet.benchmarks.estimation.process import NOT_IN_SAMPLE, Batch, Outcome, Runs, run
from fleet.benchmarks.estimation.ratios import SIZES
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan

ROUNDS = 5
FIRST_AND_SECOND = Batch("ours", *SIZES["S"], repeats=2, warm=False)


def measure(plan: Plan) -> Runs:
    """`cached_start_s` in new processes; `compile_s` once, with an empty cache."""
    plan.tell("estimation: first solves of new processes")
    runs: Runs = {
        "cached_start_s": [
            _beyond_solving(run(FIRST_AND_SECOND)) for _ in range(1 if plan.sample else ROUNDS)
        ],
        "compile_s": NOT_IN_SAMPLE,
    }
    if not plan.sample:
        with TemporaryDirectory() as empty:
            runs["compile_s"] = [_beyond_solving(run(FIRST_AND_SECOND, {"NUMBA_CACHE_DIR": empty}))]
    return runs


def _beyond_solving(o: Outcome) -> float:
    first_s, second_s = o.times_s
    return o.import_s + first_s - second_s


METRICS = (
    Metric("cached_start_s", "s", "lower", "import and first solve less the second", reach=1.0),
    Metric("compile_s", "s", "lower", "the same before anything is compiled"),
)
