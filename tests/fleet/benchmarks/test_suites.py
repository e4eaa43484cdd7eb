"""Every suite is well formed, and a small sample of it yields all its metrics."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fleet.benchmarks import NAMES, baseline
from fleet.benchmarks.replay import DataSet, figures, replay
from fleet.benchmarks.suite import Plan, Suite, load
from tagmap.errors import DataError

SMALL = ("startup", "store", "service", "constellation")


def bench(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fleet.cli", "bench", *arguments]
    env = {k: v for k, v in os.environ.items() if k != "TAGMAP_DATA"} | environment
    return subprocess.run(
        command, capture_output=True, text=True, timeout=300, check=False, env=env
    )


@pytest.mark.parametrize("name", NAMES)
def test_baseline_has_exactly_what_is_compared(name: str):
    suite = load(name)
    assert suite.name == name
    compared = {metric.key for metric in suite.metrics if metric.tolerance is not None}
    assert set(baseline.read(suite)) == compared
    assert len({metric.key for metric in suite.metrics}) == len(suite.metrics)


@pytest.mark.parametrize("name", NAMES)
def test_baseline_names_no_machine(name: str):
    text = (baseline.FOLDER / f"{name}.json").read_text()
    assert not re.search(r"/|host|cpu", text.lower())


@pytest.mark.parametrize("name", SMALL)
def test_a_sample_yields_every_metric(name: str):
    suite = load(name)
    measured = suite.run(Plan(sample=True))
    assert set(measured.figures) == {metric.key for metric in suite.metrics}


def test_a_replay_yields_every_metric(mrclam_folder: Path):
    tiny = DataSet("tiny", ("mrclam", mrclam_folder.name), (mrclam_folder.name,))
    found = figures(tiny, replay(tiny, mrclam_folder.parent))
    suite = Suite("tiny", "", tiny.metrics, lambda _: found)
    measured = suite.run(Plan())
    assert set(measured.figures) == {metric.key for metric in tiny.metrics}
    assert measured.figures["tiny_lost"].value == 0.0


def test_a_replay_that_fails_says_why(tmp_path: Path):
    with pytest.raises(DataError, match=r"tiny: replay failed: .*no such file or folder"):
        replay(DataSet("tiny", ("mrclam", "nowhere"), ("nowhere",)), tmp_path)


@pytest.mark.parametrize("plan", [Plan(sample=True), Plan(), Plan(data=Path("nowhere"))])
def test_without_recorded_data_replays_are_skipped(plan: Plan):
    measured = load("replay").run(plan)
    assert not measured.figures
    assert all(measured.skipped.values())


def test_json_is_one_object_on_stdout():
    done = bench("store", "--sample", "--json")
    assert done.returncode == 0, done.stderr
    contract = json.loads(done.stdout)
    assert (contract["suite"], contract["sample"]) == ("store", True)
    assert contract["metrics"]["batch_rate"]["value"] > 0.0


@pytest.mark.parametrize(
    "arguments", [[], ["what"], ["store", "--sample", "--check"], ["store", "--what"]]
)
def test_wrong_usage(arguments: list[str]):
    assert bench(*arguments).returncode == 2


def test_every_suite_is_documented():
    page = (Path(__file__).parents[3] / "docs" / "benchmarks.md").read_text()
    for name in NAMES:
        assert f"`{name}`" in page
        for metric in load(name).metrics:
            assert metric.key in page, f"{metric.key} of {name} is not in docs/benchmarks.md"
