"""`fleet emulate world` as people run it: it says where things are, and tags remember."""

import json
import re
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from click.testing import CliRunner

from fleet.cli.emulate_world import world
from fleet.cli.root import cli
from fleet.simulation.scenario.reading import library
from robot_agent.cameras.camera import StereoPair
from robot_agent.devices.config import read_config
from robot_agent.devices.opening import open_cameras
from tagmap.errors import ConfigError
from tests.fleet.emulation.small_world import FIXED, TAGS, TURNING, small_scenario


def test_it_says_where_everything_is_and_tags_remember(tmp_path: Path):
    scenario = small_scenario(tmp_path, FIXED, TURNING)
    memory = tmp_path / "tags.json"
    words = ["0" * 256] * len(TAGS)
    words[0] = "e511" + "0" * 252
    memory.write_text(json.dumps(dict(zip(TAGS, words, strict=True))))
    command = [sys.executable, "-m", "fleet.cli", "emulate", "world", str(scenario)]
    options = ["--out", str(tmp_path / "out"), "--memory", str(memory), "--robot", "r2", "--stand"]
    with subprocess.Popen(
        [*command, *options], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        try:
            assert process.stdout is not None
            robot, summary = process.stdout.readline(), process.stdout.readline()
            config = tmp_path / "out" / "r2" / "robot.toml"
            assert robot.startswith(f"r2: {config}: cameras ")
            assert robot.endswith(f"pan-tilt {tmp_path / 'out' / 'r2' / 'pan-tilt'}\n")
            assert summary.startswith("4 tags around; what was surveyed of them: ")
            cameras = open_cameras(read_config(config))
            assert cameras is not None
            with closing(cameras):
                assert isinstance(cameras.grab(10.0), StereoPair)
        finally:
            process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 130
    assert json.loads(memory.read_text()) == dict(zip(TAGS, words, strict=True))
    assert not (tmp_path / "out" / "r2" / "pan-tilt").is_symlink()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none"], f"none: no such file, and no scenario: {', '.join(library())}"),
        (["hall-small", "--robot", "r9"], "no robot is called r9, expected one of r1, r2, r3"),
        (["hall-small", "--away", "r1", "pan-tilt", "1", "1"], "r1 has no pan-tilt"),
    ],
)
def test_what_there_is_not(arguments: list[str], said: str, tmp_path: Path):
    command = ["emulate", "world", *arguments, "--out", str(tmp_path)]
    done = CliRunner().invoke(cli, command)
    assert isinstance(done.exception, ConfigError)
    assert said in str(done.exception)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "Missing option '--out'"),
        (["--out", "x", "--site", "A b"], "does not match"),
        (["--out", "x", "--site-number", "0"], "--site-number"),
        (["--out", "x", "--away", "r1", "arm", "1", "1"], "'arm' is not one of"),
    ],
)
def test_wrong_usage(options: list[str], said: str):
    done = CliRunner().invoke(cli, ["emulate", "world", "hall-small", *options])
    assert done.exit_code == 2
    assert said in done.stderr


def test_every_option_is_on_the_page():
    page = (Path(__file__).parents[3] / "docs" / "emulation.md").read_text()
    rows = [line for line in page.splitlines() if line.startswith("| `--")]
    listed = {option for row in rows for option in re.findall(r"`(--[a-z-]+)", row)}
    assert listed == {o for p in world.params for o in p.opts if o.startswith("--")}
