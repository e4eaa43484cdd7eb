"""The whole site on a small data set: command line in, contract out."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tagmap.store.check import check


def replay(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fleet.cli", "replay", *map(str, arguments), "--json"]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_mrclam_with_missing_files(mrclam_folder: Path, tmp_path: Path):
    """Robot 2 has no odometry and shares no landmark: withheld, while robot 1 has its map."""
    db = tmp_path / "kept.db"
    done = replay("mrclam", mrclam_folder, "--db", db)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["keyframes_sent"], result["keyframes_stored"]) == (5, 5)
    assert result["db"] == str(db)
    assert set(result["robots"]) == {"1", "2"}
    assert result["robots"]["1"]["keyframes"] == 3
    assert result["robots"]["1"]["position_rmse_m"] < 0.05
    assert result["robots"]["2"]["position_rmse_m"] is None
    assert result["landmarks"]["n"] == 4
    assert result["landmarks"]["rmse_m"] < 0.05
    assert check(db) == []


def test_starry_night(starry_night_file: Path):
    done = replay("starry-night", starry_night_file)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["keyframes_sent"], result["keyframes_stored"]) == (20, 20)
    assert result["landmarks"]["n"] == 4
    assert result["landmarks"]["rmse_m"] < 0.01
    assert result["robots"]["1"]["position_rmse_m"] < 0.01
    db = Path(result["db"])
    assert check(db) == []
    for file in db.parent.iterdir():
        file.unlink()
    db.parent.rmdir()


def test_without_truth_there_are_nulls(mrclam_folder: Path, tmp_path: Path):
    for file in mrclam_folder.glob("*Groundtruth*"):
        file.unlink()
    done = replay("mrclam", mrclam_folder, "--db", tmp_path / "site.db")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["landmarks"]["rmse_m"] is None
    assert result["robots"]["1"]["position_rmse_m"] is None
    assert result["map_version"] >= 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interruption_ends_everything_in_order(starry_night_file: Path, number: signal.Signals):
    command = ["replay", "starry-night", str(starry_night_file), "--realtime", "--json"]
    run = subprocess.Popen(
        [sys.executable, "-m", "fleet.cli", *command], stderr=subprocess.PIPE, text=True
    )
    assert run.stderr is not None
    said = run.stderr.readline()
    pids = [int(word.split("=")[1]) for word in said.split() if "pid=" in word]
    assert len(pids) == 2
    time.sleep(0.5)
    run.send_signal(number)
    _, rest = run.communicate(timeout=60)
    assert run.returncode == 130, rest
    assert rest.splitlines()[-1] == "fleet: interrupted, everything is stopped"
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)
