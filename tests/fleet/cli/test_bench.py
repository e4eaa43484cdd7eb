"""`fleet bench` on a made-up suite: what it prints, keeps, and how it exits."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from fleet.benchmarks import baseline, suite
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Suite
from fleet.cli.bench import bench

METRICS = (
    Metric("wall_s", "s", "lower", "a time"),
    Metric("slowdown", "x", "lower", "a ratio", tolerance=0.5),
)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Result]:
    """`run(slowdown, *options)` against a baseline of 2 in a folder of the test's."""

    def with_folder(function: Callable[..., object]) -> Callable[..., object]:
        return lambda *arguments: function(*arguments, tmp_path)

    monkeypatch.setattr(baseline, "read", with_folder(baseline.read))
    monkeypatch.setattr(baseline, "write", with_folder(baseline.write))
    (tmp_path / "startup.json").write_text('{"slowdown": 2.0}')

    def invoke(slowdown: float, *options: str) -> Result:
        fake = Suite(
            "startup", "", METRICS, lambda _: {"wall_s": [9.0, 1.0, 3.0], "slowdown": [slowdown]}
        )
        monkeypatch.setattr(suite, "load", lambda _: fake)
        return CliRunner().invoke(bench, ["startup", *options])

    return invoke


def test_worse_than_the_baseline_is_exit_1_and_a_line(run: Callable[..., Result]):
    done = run(4.0, "--check")
    assert done.exit_code == 1
    assert done.stderr == "startup slowdown: 4 x is 100% worse than 2 x, tolerated 50%\n"
    assert run(4.0).exit_code == 0
    assert run(2.5, "--check").exit_code == 0


def test_json_is_alone_on_stdout(run: Callable[..., Result]):
    done = run(4.0, "--json", "--check")
    assert done.exit_code == 1
    metrics = json.loads(done.stdout)["metrics"]
    assert metrics["wall_s"]["value"] == 3.0
    assert metrics["slowdown"]["baseline"] == 2.0


def test_a_baseline_is_updated_on_demand_only(run: Callable[..., Result], tmp_path: Path):
    file = tmp_path / "startup.json"
    run(3.0, "--check")
    assert json.loads(file.read_text()) == {"slowdown": 2.0}
    assert run(3.0, "--update-baseline").exit_code == 0
    assert json.loads(file.read_text()) == {"slowdown": 3.0}
