"""`fleet load` with real processes: everything is stored once, whether it ends by itself or not."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fleet.load.test_recorded import journal

COMMAND = [sys.executable, "-m", "fleet.cli", "load"]
TIMES = {"n", "missing", "p50", "p95", "p99", "max"}
QUEUE = {"p50", "p95", "max", "slope_per_s", "first_p90", "last_p50", "growing", "series"}
PROCESSES = {"service", "router", "generator"}
CONTRACT = {
    *("robots", "source", "tags_hung", "seed", "interrupted", "reach_ms", "rate_hz", "duration_s"),
    *("reached", "ack_ms", "pose_ms", "late_ms", "queue", "cores", "rss_mb", "generator_share"),
    *("load_average", "keyframes", "map"),
}


def load(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [*COMMAND, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def assert_stored_once(contract: dict, sent: int | None = None):
    keyframes = contract["keyframes"]
    assert keyframes["sent"] == (sent or keyframes["sent"])
    assert keyframes["settled"] == keyframes["stored"] == keyframes["sent"]
    assert keyframes["refused"] == 0
    assert keyframes["duplicates"] <= keyframes["resent"]
    assert contract["ack_ms"]["missing"] == 0


def test_four_robots_for_two_seconds():
    done = load("--robots", "4", "--tags", "40", "--duration-s", "2", "--seed", "3", "--json")
    assert done.returncode == 0, done.stderr
    contract = json.loads(done.stdout)
    assert set(contract) == CONTRACT
    assert_stored_once(contract, sent=80)
    assert (contract["robots"], contract["rate_hz"], contract["seed"]) == (4, 10.0, 3)
    assert set(contract["ack_ms"]) == set(contract["pose_ms"]) == set(contract["late_ms"]) == TIMES
    assert contract["ack_ms"]["n"] == contract["pose_ms"]["n"] == 80
    assert set(contract["queue"]) == QUEUE
    assert set(contract["cores"]) >= PROCESSES
    assert set(contract["map"]) == {"version", "tags", "solves"}


def test_ctrl_c_shows_what_was_measured_so_far(tmp_path: Path):
    """Two robots with the same journal, ten minutes long."""
    journal(tmp_path / "a.journal", 50)
    command = [*COMMAND, "--from", str(tmp_path), "--robots", "2", "--rate-hz", "5"]
    command += ["--duration-s", "600", "--json"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        assert any(line.startswith("sending") for line in process.stderr)
        process.send_signal(signal.SIGINT)
        stdout, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    contract = json.loads(stdout)
    assert contract["interrupted"] is True
    assert contract["source"] == "journals"
    assert_stored_once(contract)
    assert contract["keyframes"]["sent"] < 100


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--robots", "0"], 2, "0 is not in the range 1<=x<=1000"),
        (["--rate-hz", "-1"], 2, "-1.0 is not in the range"),
        (["--duration-s", "fast"], 2, "'fast' is not a valid float"),
        (["--from", "FOLDER", "--tags", "9"], 2, "--tags is of a simulated hall"),
        (["--from", "nowhere"], 2, "'nowhere' does not exist"),
        (["--from", "FOLDER"], 1, "no *.journal in it"),
        (["--rate-hz", "900", "--duration-s", "900"], 1, "at most 2000000 are held in memory"),
    ],
)
def test_bad_arguments_are_one_line(tmp_path: Path, arguments: list, status: int, message: str):
    done = load(*(tmp_path if one == "FOLDER" else one for one in arguments))
    assert (done.returncode, done.stdout) == (status, "")
    assert message in done.stderr.splitlines()[-1]
