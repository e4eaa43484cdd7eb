"""`fleet demo` is one run of one scenario in true time, with the options that it was given."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from fleet.cli import live
from fleet.cli.root import cli
from tagmap.errors import TagmapError
from tagmap.store.check import check

Given = list[tuple[object, ...]]


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Given:
    """What is to be played; nothing is."""
    noted: Given = []

    def play(scenario, seed, folder, stopped):  # noqa: ARG001
        noted.append((scenario.name, scenario.duration_s, len(scenario.robot), seed, folder))
        raise TagmapError("played")

    monkeypatch.setattr(live, "played_live", play)
    monkeypatch.chdir(tmp_path)
    return noted


def test_without_options_it_goes_into_a_new_folder_here(given: Given, tmp_path: Path):
    done = CliRunner().invoke(cli, ["demo"])
    assert str(done.exception) == "played"
    ((name, duration_s, robots, seed, folder),) = given
    assert (name, duration_s, robots, seed) == ("demo", 100.0, 3, 1)
    assert folder.parent == tmp_path
    assert folder.name.startswith("demo-")


def test_options_are_passed_on(given: Given, tmp_path: Path):
    CliRunner().invoke(cli, ["demo", "--seed", "7", "--duration-s", "20", "--out", "mine"])
    ((_, duration_s, _, seed, folder),) = given
    assert (duration_s, seed, folder) == (20.0, 7, tmp_path / "mine")


def test_live_is_no_other_run(given: Given):
    CliRunner().invoke(cli, ["run", "hall-small", "--live", "--exact"])
    assert [one[:4] for one in given] == [("hall-small", 300.0, 3, 1)]


@pytest.mark.slow
def test_from_nothing_to_a_map_that_is_in_the_tags(tmp_path: Path):
    command = [sys.executable, "-m", "fleet.cli", "demo", "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    scores = json.loads(done.stdout)
    (folder,) = tmp_path.iterdir()
    assert Path(scores["db"]) == folder / "site.db"
    assert scores["keyframes_stored"] == scores["keyframes_sent"] > 200
    assert scores["keyframes_lost"] == scores["ids_wrong"] == 0
    # A write that light or radio did not last for leaves a torn slot, and the robot says so.
    assert scores["records_torn"] <= len(_failed_writes(folder))
    assert scores["tags_mapped"] >= 16
    assert scores["tag_rmse_anchored_m"] < 0.03
    assert scores["records_right"] >= 6
    assert "<html" in Path(scores["report"]).read_text()
    for picture in ("plan", "growth", "poses", "acks"):
        assert (folder / f"{picture}.png").read_bytes().startswith(b"\x89PNG")
    assert check(folder / "site.db") == []


def _failed_writes(folder: Path) -> set[str]:
    """Tags at which a job failed, by the agents' logs."""
    lines = (line for log in folder.glob("agent-*.log") for line in log.read_text().splitlines())
    events = [json.loads(line) for line in lines if line.startswith("{")]
    jobs = [event for event in events if event.get("event") == "job"]
    return {job["tag"] for job in jobs if job["outcome"] == "failed"}
