"""The page says what the cameras do: settings, defaults and reasons."""

import re
from pathlib import Path
from typing import get_args

from robot_agent.cameras.camera import Reason
from robot_agent.cameras.folder import FolderConfig
from robot_agent.cameras.network import NetworkConfig
from robot_agent.cameras.opencv import OpenCvConfig

PAGE = (Path(__file__).parents[3] / "docs" / "cameras.md").read_text()
CONFIGS = (FolderConfig, OpenCvConfig, NetworkConfig)


def test_settings_and_reasons_are_on_the_page():
    rows = re.findall(r"^\| (`.*?`) \|", PAGE, re.MULTILINE)
    first_column = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    settings = {name for config in CONFIGS for name in config.__struct_fields__}
    assert first_column == settings | set(get_args(Reason))


def test_defaults_are_those_of_the_page():
    for config in CONFIGS:
        defaults = dict(zip(config.__struct_fields__[1:], config.__struct_defaults__, strict=True))
        for name, default in defaults.items():
            shown = {None: "none"}.get(default, str(default)) if name != "set" else "{}"
            assert re.search(rf"^\| .*`{name}`.* \| {re.escape(shown)} \|", PAGE, re.MULTILINE), (
                name
            )
