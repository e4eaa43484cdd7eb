"""The page says what the programs do: options, settings, reasons, and a scene that is one."""

import re
from pathlib import Path
from typing import get_args

from fleet.cli.emulate import llrp
from fleet.simulation.scene.description import build, read_description
from robot_agent.rfid.llrp.driver import LlrpConfig
from robot_agent.rfid.reader import Reason

PAGE = (Path(__file__).parents[3] / "docs" / "llrp.md").read_text()


def first_column() -> set[str]:
    return {found[1] for found in re.finditer(r"^\| `(\S+?)(?:`| )", PAGE, re.MULTILINE)}


def test_options_settings_and_reasons_are_on_the_page():
    options = {option for parameter in llrp.params for option in parameter.opts}
    assert options | set(LlrpConfig.__struct_fields__) | set(get_args(Reason)) <= first_column()


def test_defaults_are_those_of_the_page():
    for name, default in zip(
        LlrpConfig.__struct_fields__[1:], LlrpConfig.__struct_defaults__, strict=True
    ):
        shown = f"`{list(default)}`" if isinstance(default, tuple) else str(default)
        assert f"| `{name}` | {shown} |" in PAGE


def test_the_scene_of_the_page_is_one(tmp_path: Path):
    [example] = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    file = tmp_path / "scene.toml"
    file.write_text(example)
    scene = build(read_description(file), "r1", 0)
    assert [len(tag.memory.words) for tag in scene.tags] == [18, 32, 64, 64]
