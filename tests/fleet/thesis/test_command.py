"""`fleet thesis` as a user runs it: wrong usage, folders that cannot be, and Ctrl-C."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fleet.cli import thesis as command
from fleet.cli.root import cli
from tagmap.errors import DataError

FLEET = [sys.executable, "-m", "fleet.cli", "thesis"]


def fleet(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    call = [*FLEET, *map(str, arguments)]
    return subprocess.run(call, capture_output=True, text=True, timeout=300, check=False)


def test_help():
    done = fleet("-h")
    assert done.returncode == 0
    assert "danger cylinder" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seed", "-1"], "--seed"),
        (["--seed", "x"], "--seed"),
        (["--what"], "No such option"),
        (["extra"], "unexpected extra argument"),
    ],
)
def test_wrong_usage(tmp_path: Path, arguments: list[str], message: str):
    done = fleet("--out", tmp_path / "out", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_folder_must_be_new_or_empty(tmp_path: Path):
    (tmp_path / "something").write_text("")
    done = fleet("--out", tmp_path)
    assert (done.returncode, done.stderr) == (1, f"fleet: {tmp_path}: is not empty\n")


def test_a_folder_that_cannot_be(tmp_path: Path):
    (tmp_path / "file").write_text("")
    done = fleet("--out", tmp_path / "file" / "out")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "cannot be made: Not a directory" in done.stderr
    assert fleet("--out", tmp_path / "file").returncode == 2


def test_without_matplotlib_it_says_what_to_install(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(command, "find_spec", lambda _: None)
    with pytest.raises(DataError, match=r"pip install tagmap\[plot\]"):
        cli(["thesis", "--out", str(tmp_path / "out")], standalone_mode=False)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_goes_away_is_one_line(tmp_path: Path, monkeypatch):
    from fleet.thesis import run as running
    from fleet.thesis.effort import SAMPLE

    make = dict(running.SECTIONS)["danger_cylinder"]
    monkeypatch.setattr(running, "SECTIONS", (("danger_cylinder", make),))
    with pytest.raises(DataError, match="cannot be written: No such file"):
        running.run(tmp_path / "gone", SAMPLE, 1, lambda _: None)


def test_interrupted_it_keeps_what_it_has(tmp_path: Path):
    out = tmp_path / "out"
    with subprocess.Popen(
        [*FLEET, "--sample", "--out", str(out)], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        try:
            end_s = time.monotonic() + 240.0
            while not (out / "numbers.json").exists() and time.monotonic() < end_s:
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
            told = process.stderr.read()
            assert process.wait(60.0) == 130
        finally:
            process.kill()
    numbers = json.loads((out / "numbers.json").read_text())
    assert numbers["complete"] is False
    assert "figure_3_12" in numbers["sections"]
    assert (out / "figure-3-12.png").exists()
    assert (out / "report.html").read_text().endswith("</html>\n")
    assert "figure 3-12  (1 of 12)" in told
    assert "interrupted" in told
    assert f"report so far  {out}" in told


@pytest.mark.slow
def test_json_is_what_the_file_holds(tmp_path: Path):
    done = fleet("--sample", "--json", "--seed", "3", "--out", tmp_path / "out")
    assert done.returncode == 0
    printed = json.loads(done.stdout)
    assert printed == json.loads((tmp_path / "out" / "numbers.json").read_text())
    assert (printed["seed"], printed["complete"]) == (3, True)
