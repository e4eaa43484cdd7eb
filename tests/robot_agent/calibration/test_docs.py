"""The page says what the command does."""

import json
import re
from pathlib import Path

from click.testing import CliRunner

from robot_agent.cli import main
from robot_agent.cli.calibrate import stereo

DOCS = Path(__file__).parents[3] / "docs"
PAGE = (DOCS / "calibration.md").read_text()


def test_every_option_is_on_the_page():
    table = set(re.findall(r"^\| `(--[a-z-]+)", PAGE, re.MULTILINE))
    options = {option for parameter in stereo.params for option in parameter.opts}
    assert table == {option for option in options if option.startswith("--")}


def test_every_picture_is_there():
    for name in re.findall(r"!\[.*?\]\((.*?)\)", PAGE):
        assert (DOCS / name).is_file(), name


def test_every_key_of_the_answer_is_on_the_page(boards_folder, tmp_path):
    command = ["calibrate", "stereo", str(boards_folder), "--board", "9x6", "--square-m", "0.03"]
    done = CliRunner().invoke(main, [*command, "--out", str(tmp_path / "rig.toml"), "--json"])
    told = json.loads(done.stdout)
    nested = [told["cameras"]["left"], told["cameras"]["left"]["sigmas"], told["sigmas"]]
    for keys in (told, *nested, next(iter(told["pairs"].values()))):
        for key in keys:
            assert f'"{key}"' in PAGE, key
