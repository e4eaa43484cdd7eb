"""`robot-agent calibrate scanner` on files a user would have, and on wrong ones."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fleet.evaluation.aim import aim_error_m
from fleet.simulation import scanning
from robot_agent.cli import main
from robot_agent.cli.calibrate_scanner import scanner as command
from tagmap.geometry.scanner.aiming import aim
from tagmap.records.arrays import drive, scanner
from tagmap.records.scanner_file import read_scanner

DOCS = Path(__file__).parents[4] / "docs"
DRIVE = """
[drive]
limits_x_rad = [-0.2, 0.2]
limits_y_rad = [-0.1, 0.1]
v_per_rad = [40.0, -40.0]
limits_v = [-5.0, 5.0]
dac_bits = 12
"""


def run(samples: Path, out: Path, *options: str):
    command = ["calibrate", "scanner", str(samples), "--out", str(out), *options]
    return CliRunner().invoke(main, command)


def test_samples_give_a_scanner_that_aims(grid_of, write_samples, tmp_path: Path) -> None:
    truth, samples = grid_of(1)
    samples.p_cam[4, 0] += 0.1
    out = tmp_path / "scanner.toml"
    done = run(write_samples(samples), out, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert list(told["rejected"]) == ["6"]
    assert told["samples"] == 29
    assert told["fixed"] == ["neutral_1_rad", "neutral_2_rad"]
    assert told["held_out"]["near"]["range_m"] < 4.0 < told["held_out"]["far"]["range_m"]
    record = read_scanner(out)
    found = scanner(record)
    targets = scanning.anywhere(np.random.default_rng(1), 200, (3.0, 3.0))
    assert aim_error_m(found, truth, targets) < 0.005
    assert not aim(found, drive(record.drive), targets).refused.any()
    assert aim(found, drive(record.drive), targets).off_m.max() < 1e-4
    assert np.sqrt(np.diag(found.cov))[:3] == pytest.approx(told["sigmas"]["p_m"], rel=1e-9)


def test_the_file_says_how_good_it_is(grid_of, write_samples, tmp_path: Path) -> None:
    _, samples = grid_of(2)
    samples.p_cam[4, 0] += 0.1
    out = tmp_path / "scanner.toml"
    done = run(write_samples(samples), out, "--model", "simplified")
    assert done.exit_code == 0, done.output
    assert "times the stated noise: try --model full" in done.stderr
    assert "held out near" in done.stdout
    text = out.read_text()
    assert re.search(r"^# held-out samples near: at .* off by", text)
    assert "# fixed: no beam tells it from a turn of T_cam_laser about x" in text
    assert "skew_rad = 0.0  # as built" in text
    record = read_scanner(out)
    assert (record.model, len(record.cov)) == ("simplified", 28)
    assert record.by.startswith("robot-agent ")
    assert record.made.endswith("Z")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["samples.csv", "scanner.toml"]


def test_the_drive_is_taken_from_a_file(grid_of, write_samples, tmp_path: Path) -> None:
    (tmp_path / "drive.toml").write_text(DRIVE)
    first, again = tmp_path / "scanner.toml", tmp_path / "again.toml"
    samples = write_samples(grid_of(3)[1])
    assert run(samples, first, "--drive", str(tmp_path / "drive.toml")).exit_code == 0
    assert run(samples, again, "--drive", str(first)).exit_code == 0
    assert read_scanner(again).drive == read_scanner(first).drive
    assert read_scanner(first).drive.limits_v == (-5.0, 5.0)
    assert read_scanner(first).drive.dac_v == (-10.0, 10.0)
    assert run(samples, first).exit_code == 0
    assert read_scanner(first).drive == read_scanner(again).drive


def refused(samples: Path, out: Path, *options: str) -> str:
    done = run(samples, out, *options)
    assert done.exit_code == 1, done.output
    assert not out.exists()
    (line,) = done.stderr.splitlines()
    return line


def test_what_is_refused_says_why_in_one_line(grid_of, write_samples, tmp_path: Path) -> None:
    samples, out = write_samples(grid_of(4)[1]), tmp_path / "scanner.toml"
    assert "expected a name that ends in .toml" in refused(samples, tmp_path / "scanner.txt")
    assert "no folder" in refused(samples, tmp_path / "none" / "scanner.toml")
    assert "cannot be read: No such file" in refused(tmp_path / "none.csv", out)
    assert "No such file" in refused(samples, out, "--drive", str(tmp_path / "none.toml"))
    for text, message in (
        ("", "no table [drive]"),
        ("[drive]\nlimit_v = 5", "unknown key drive.limit_v, expected"),
        ("[drive]\nlimits_v = [5.0, -5.0]", "limits_v is [5.0, -5.0], expected least and most"),
        ("[drive]\nlimits_x_rad = [-20.0, 20.0]", "expected angles in rad"),
        ("[drive]\nv_per_rad = [0.0, 1.0]", "expected two that are not 0"),
    ):
        (tmp_path / "drive.toml").write_text(text)
        assert message in refused(samples, out, "--drive", str(tmp_path / "drive.toml"))
    lines = samples.read_text().splitlines()
    samples.write_text("\n".join(lines[:8]))
    assert f"{samples}: 7 good samples, expected at least 10" in refused(samples, out)
    samples.write_text("\n".join([*lines[:3], "1,2,3"]))
    assert f"{samples}: line 4: 3 columns, expected 5" in refused(samples, out)


def test_every_option_and_every_key_is_on_the_page(grid_of, write_samples, tmp_path: Path) -> None:
    page = (DOCS / "scanner.md").read_text()
    table = set(re.findall(r"^\| `(--[a-z-]+)", page, re.MULTILINE))
    options = {option for parameter in command.params for option in parameter.opts}
    assert table == {option for option in options if option.startswith("--")}
    told = json.loads(run(write_samples(grid_of(5)[1]), tmp_path / "scanner.toml", "--json").stdout)
    for keys in (told, told["held_out"], told["held_out"]["near"], told["mirrors"], told["sigmas"]):
        for key in keys:
            assert f'"{key}"' in page or f"`{key}`" in page, key
    for name in re.findall(r"!\[.*?\]\((.*?)\)", page):
        assert (DOCS / name).is_file(), name
