"""How well recorded robots are mapped and found, from nothing, through the whole chain."""

import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite
from tagmap.errors import DataError

WALL_REACH_S = 120.0
GIVE_UP_S = 900.0
# The same keyframes give the same map but for rounding; 10 % is a different estimator.
SAME = 0.1


@dataclass(frozen=True, slots=True)
class DataSet:
    """A recorded set: `arguments` of `fleet replay`, of which `files` are below the data folder.

    The rest is the reach: RMSE of the landmarks, and the largest median and RMSE of the positions
    of one robot (the median over all robots cannot be larger than that). None: nothing promised.
    """

    key: str
    arguments: tuple[str, ...]
    files: tuple[str, ...]
    landmarks_m: float | None = None
    worst_median_m: float | None = None
    worst_rmse_m: float | None = None

    @property
    def metrics(self) -> tuple[Metric, ...]:
        def error(name: str, about: str, reach: float | None) -> Metric:
            return Metric(f"{self.key}_{name}_m", "m", "lower", about, tolerance=SAME, reach=reach)

        return (
            error("landmarks_rmse", "landmarks, RMSE", self.landmarks_m),
            error("worst_median", "largest median position error of a robot", self.worst_median_m),
            error("worst_rmse", "largest position RMSE of a robot", self.worst_rmse_m),
            Metric(f"{self.key}_lost", "1", "lower", "keyframes sent, not stored", reach=0.0),
            Metric(f"{self.key}_wall_s", "s", "lower", "start to result", reach=WALL_REACH_S),
            Metric(f"{self.key}_solve_s", "s", "lower", "the final solve"),
        )


# Each MRCLAM set is judged with cameras that were fitted to the other one.
DATA_SETS = (
    DataSet(
        "mrclam_6",
        ("mrclam", "mrclam/MRCLAM_Dataset6.tar.xz", "--cameras-from-set", "1"),
        ("mrclam/MRCLAM_Dataset6.tar.xz",),
        landmarks_m=0.050,
        worst_median_m=0.085,
        worst_rmse_m=0.13,
    ),
    DataSet(
        "mrclam_1",
        (
            "mrclam",
            "mrclam/MRCLAM_Dataset1.tar.xz",
            "--truth",
            "mrclam/sparse_groundtruth_D1.csv",
            "--truth-swap",
            "11:17",
            "--cameras-from-set",
            "6",
        ),
        ("mrclam/MRCLAM_Dataset1.tar.xz", "mrclam/sparse_groundtruth_D1.csv"),
        landmarks_m=0.025,
    ),
    DataSet(
        "starry_night",
        ("starry-night", "starry_night/starry_night_dataset.mat"),
        ("starry_night/starry_night_dataset.mat",),
        landmarks_m=0.006,
        worst_rmse_m=0.045,
    ),
)


def measure(plan: Plan) -> dict[str, list[float] | str]:
    """Once each: the same keyframes give the same map."""
    found: dict[str, list[float] | str] = {}
    for data_set in DATA_SETS:
        reason = why_not(data_set, plan)
        if reason is None:
            assert plan.data is not None
            plan.tell(f"replay: {data_set.key}")
            found |= figures(data_set, replay(data_set, plan.data))
        else:
            found |= dict.fromkeys((metric.key for metric in data_set.metrics), reason)
    return found


def why_not(data_set: DataSet, plan: Plan) -> str | None:
    """Why it cannot be played."""
    if plan.sample:
        return "a sample does without recorded data"
    if plan.data is None:
        return "no folder of recorded data is given, see --data"
    absent = [file for file in data_set.files if not (plan.data / file).exists()]
    return f"no {' and no '.join(absent)} in {plan.data}" if absent else None


def replay(data_set: DataSet, data: Path) -> dict[str, Any]:
    """What `fleet replay --json` says. DataError when it fails."""
    words = [str(data / word) if word in data_set.files else word for word in data_set.arguments]
    with tempfile.TemporaryDirectory(prefix="tagmap-bench-") as folder:
        db = ["--db", str(Path(folder) / "site.db")]
        command = [sys.executable, "-m", "fleet.cli", "replay", *words, *db, "--json"]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=GIVE_UP_S, check=False
        )
    if done.returncode:
        said = done.stderr.splitlines() or ["no reason given"]
        raise DataError(f"{data_set.key}: replay failed: {said[-1]}")
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def figures(data_set: DataSet, result: dict[str, Any]) -> dict[str, list[float] | str]:
    """The metrics of a data set; what its truth does not tell is a reason."""
    robots = result["robots"].values()
    lost = result["keyframes_sent"] - result["keyframes_stored"]
    values = (
        result["landmarks"]["rmse_m"],
        _largest([robot["position_median_m"] for robot in robots]),
        _largest([robot["position_rmse_m"] for robot in robots]),
        lost,
        result["wall_s"],
        result["solve_s"],
    )
    return {
        metric.key: "its truth is not known" if value is None else [float(value)]
        for metric, value in zip(data_set.metrics, values, strict=True)
    }


def _largest(errors: list[float | None]) -> float | None:
    return max((error for error in errors if error is not None), default=None)


METRICS = tuple(metric for data_set in DATA_SETS for metric in data_set.metrics)
SUITE = Suite("replay", "how well recorded robots are mapped and found", METRICS, measure)
