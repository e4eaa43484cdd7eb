"""What counts as worse, with made-up numbers."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from fleet.benchmarks import baseline
from fleet.benchmarks.gate import regressions
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.report import as_contract, show
from fleet.benchmarks.suite import Figure, Measured, Plan, Suite
from tagmap.errors import DataError

METRICS = (
    Metric("wall_s", "s", "lower", "a time", reach=1.0),
    Metric("slowdown", "x", "lower", "a ratio", tolerance=0.5),
    Metric("gain", "x", "higher", "a ratio", tolerance=0.5),
    Metric("rmse_m", "m", "lower", "an accuracy", tolerance=0.1, reach=0.05),
)
BASELINE = {"slowdown": 2.0, "gain": 3.0, "rmse_m": 0.04}


def suite(found: Mapping[str, Sequence[float] | str]) -> Suite:
    return Suite("fake", "made up", METRICS, lambda _: found)


def judged(**changes: float | str) -> list[str]:
    values: dict[str, float | str] = {"wall_s": 0.5, **BASELINE, **changes}
    fake = suite({key: v if isinstance(v, str) else [v] for key, v in values.items()})
    return regressions(fake, fake.run(Plan()), BASELINE)


def test_as_good_or_better_passes():
    assert judged() == []
    assert judged(slowdown=1.0, gain=9.0, rmse_m=0.0) == []


def test_within_tolerance_passes():
    assert judged(slowdown=2.99, gain=2.01, rmse_m=0.0439) == []


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {"slowdown": 3.2},
            "fake slowdown: 3.2 x is 60% worse than 2 x, tolerated 50%",
        ),
        ({"gain": 1.5}, "fake gain: 1.5 x is 100% worse than 3 x, tolerated 50%"),
        ({"gain": 0.0}, "fake gain: 0 x is inf% worse than 3 x, tolerated 50%"),
        ({"rmse_m": 0.045}, "fake rmse_m: 0.045 m is 12% worse than 0.04 m, tolerated 10%"),
        ({"rmse_m": 0.06}, "fake rmse_m: 0.06 m misses the reach of 0.05 m"),
    ],
)
def test_worse_is_one_line(changes: dict[str, float | str], line: str):
    assert judged(**changes) == [line]


def test_times_are_never_judged():
    assert judged(wall_s=100.0) == []
    with pytest.raises(ValueError, match="compare a ratio"):
        Metric("wall_s", "s", "lower", "a time", tolerance=0.1)


def test_what_was_skipped_is_not_judged():
    assert judged(rmse_m="no data") == []


def test_without_baseline_only_the_reach_is_known():
    fake = suite({"wall_s": [0.5], "slowdown": [1.0], "gain": [1.0], "rmse_m": [0.06]})
    lines = regressions(fake, fake.run(Plan()), {})
    assert [line.split(":")[0] for line in lines] == ["fake slowdown", "fake gain", "fake rmse_m"]
    assert "no baseline" in lines[0]
    assert "misses the reach" in lines[2]


def test_figures_are_medians():
    assert Figure((9.0, 1.0, 2.0)).value == 2.0
    assert Figure((1.0, 2.0)).value == 1.5


@pytest.mark.parametrize(
    "found",
    [
        {"wall_s": [1.0]},
        {"wall_s": [1.0], "slowdown": [1.0], "gain": [1.0], "rmse_m": [1.0], "more": [1.0]},
        {"wall_s": [], "slowdown": [1.0], "gain": [1.0], "rmse_m": [1.0]},
        {"wall_s": [float("nan")], "slowdown": [1.0], "gain": [1.0], "rmse_m": [1.0]},
    ],
)
def test_a_suite_must_yield_its_metrics(found: dict[str, list[float]]):
    with pytest.raises(DataError):
        suite(found).run(Plan())


def test_baseline_keeps_what_is_compared(tmp_path: Path):
    fake = suite({"wall_s": [0.5], "slowdown": [1.23456], "gain": [4.0], "rmse_m": "no data"})
    values = baseline.updated(fake, fake.run(Plan()), BASELINE)
    path = baseline.write(fake, values, tmp_path)
    assert json.loads(path.read_text()) == {"slowdown": 1.235, "gain": 4.0, "rmse_m": 0.04}
    assert baseline.read(fake, tmp_path) == values


@pytest.mark.parametrize("text", ["{", "[1]", '{"gain": "3"}', '{"gain": true}'])
def test_a_bad_baseline_is_named(tmp_path: Path, text: str):
    (tmp_path / "fake.json").write_text(text)
    with pytest.raises(DataError, match=r"fake\.json"):
        baseline.read(suite({}), tmp_path)


def test_no_baseline_is_an_empty_one(tmp_path: Path):
    assert baseline.read(suite({}), tmp_path) == {}


def test_contract_and_table(capsys: pytest.CaptureFixture[str]):
    fake = suite({"wall_s": [0.5, 0.7, 0.4], "slowdown": [1.0], "gain": [4.0], "rmse_m": "no data"})
    measured: Measured = fake.run(Plan())
    contract = as_contract(fake, measured, BASELINE, sample=False)
    assert contract["skipped"] == {"rmse_m": "no data"}
    assert contract["metrics"]["wall_s"] == {
        "value": 0.5,
        "low": 0.4,
        "high": 0.7,
        "runs": 3,
        "reached": True,
        "baseline": None,
        "unit": "s",
        "direction": "lower",
        "about": "a time",
        "tolerance": None,
        "reach": 1.0,
    }
    show(contract)
    shown = capsys.readouterr().out
    assert "slowdown" in shown
    assert "yes" in shown


def test_a_ratio_of_times_is_judged_only_on_demand():
    metric = Metric("ours_by_theirs", "x", "lower", "time by time", tolerance=0.1, reach=2.0)
    suite = Suite("speed", "", (metric,), lambda _: {metric.key: [3.0]})
    measured = suite.run(Plan())
    assert len(regressions(suite, measured, {metric.key: 1.0})) == 1
    assert regressions(suite, measured, {metric.key: 1.0}, speed=False) == []
