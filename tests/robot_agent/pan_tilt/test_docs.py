"""The page says what the programs do: options, settings and reasons."""

import re
from pathlib import Path
from typing import get_args

from fleet.cli.emulate import pan_tilt
from robot_agent.pan_tilt.ptu.driver import PtuConfig
from robot_agent.pan_tilt.unit import Reason

PAGE = (Path(__file__).parents[3] / "docs" / "pan-tilt.md").read_text()


def test_options_settings_and_reasons_are_on_the_page():
    first_column = set(re.findall(r"^\| `(\S+?)(?:`| )", PAGE, re.MULTILINE))
    options = {option for parameter in pan_tilt.params for option in parameter.opts}
    assert first_column == options | {*PtuConfig.__struct_fields__, *get_args(Reason)}


def test_defaults_are_those_of_the_page():
    for name, default in zip(
        PtuConfig.__struct_fields__[1:], PtuConfig.__struct_defaults__, strict=True
    ):
        shown = {None: "none", True: "true"}.get(default, str(default))
        assert f"| `{name}` | {shown} |" in PAGE
