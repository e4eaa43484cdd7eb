"""What goes wrong before anything is started: one clear line, and the right exit status."""

import subprocess
import sys
from pathlib import Path

import pytest


def fleet(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fleet.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("arguments", [["-h"], ["replay", "-h"], ["demo", "-h"]])
def test_help(arguments: list[str]):
    done = fleet(*arguments)
    assert done.returncode == 0
    assert done.stdout.startswith("Usage: fleet")


def test_help_imports_nothing_heavy():
    code = "import sys, fleet.cli; print(sorted(m for m in sys.modules if '.' not in m))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    for heavy in ("numpy", "scipy", "zenoh", "msgspec", "rich", "matplotlib", "sqlite_utils"):
        assert f"'{heavy}'" not in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["mrclam", "nowhere"], "nowhere: no such file or folder"),
        (["starry-night", "nowhere.mat"], "nowhere.mat: no such file or folder"),
        (["mrclam", "FOLDER", "--truth", "nowhere.csv"], "nowhere.csv: cannot be read"),
        (["mrclam", "FOLDER", "--truth-swap", "6:99"], "no landmark 99"),
        (["mrclam", "FOLDER", "--db", "DB"], "exists already"),
    ],
)
def test_wrong_paths_are_one_line(mrclam_folder: Path, arguments: list[str], message: str):
    db = mrclam_folder / "old.db"
    db.write_text("something")
    filled = {"FOLDER": mrclam_folder, "DB": db}
    done = fleet("replay", *(filled.get(a, a) for a in arguments))
    assert done.returncode == 1
    assert done.stdout == ""
    last = done.stderr.splitlines()[-1]
    assert last.startswith("fleet: ")
    assert message in last


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--truth-swap", "6"], "two different landmarks"),
        (["--depth-ratio", "-1"], "--depth-ratio is -1.0, expected more than 0"),
        (["--what"], "No such option"),
    ],
)
def test_wrong_usage(mrclam_folder: Path, option: list[str], message: str):
    done = fleet("replay", "mrclam", mrclam_folder, *option)
    assert done.returncode == 2
    assert message in done.stderr


def test_a_seed_is_not_negative(tmp_path: Path):
    assert fleet("demo", "--out", tmp_path / "out", "--seed", "-1").returncode == 2
    assert not (tmp_path / "out").exists()


def test_a_demo_needs_an_empty_folder(tmp_path: Path):
    (tmp_path / "something").write_text("")
    done = fleet("demo", "--out", tmp_path)
    assert (done.returncode, done.stderr) == (1, f"fleet: {tmp_path}: is not empty\n")
