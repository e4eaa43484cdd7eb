"""`fleet demo` is one run of one scenario in true time, with the options that it was given."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from fleet.cli import live
from fleet.cli.root import cli
from tagmap.errors import TagmapError

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
