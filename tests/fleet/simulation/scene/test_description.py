"""Scenes as files."""

from pathlib import Path

import pytest

from fleet.simulation.scene.description import build, read_description
from tagmap.errors import ConfigError

EXAMPLE = """
seed = 4
[reader]
p_m = [0, 0, 2.0]
missed = 0.1
[[tag]]
epc = "e20047000000000000000001"
user = "e5100001"
lit = "always"
[[tag]]
epc = "e20047000000000000000001"
name = "twin"
lit = {period_s = 1.0, on_s = 0.5, start_s = 2.0}
power_fails_after = [5, 12]
"""


def test_a_file_becomes_a_scene(tmp_path: Path):
    file = tmp_path / "scene.toml"
    file.write_text(EXAMPLE)
    scene = build(read_description(file), "r1", start_ns=10**9)
    first, twin = scene.tags
    assert first.memory.words == (0xE510, 0x0001)
    assert len(twin.memory.words) == 64
    assert twin.faults.power_fails_after == [5, 12]
    seconds = 10**9
    assert scene.lit_since(first, 0) == 0
    lit = [scene.lit_since(twin, t * seconds // 10) for t in (25, 30, 34, 35)]
    assert lit == [None, 3 * seconds, 3 * seconds, None]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[tag]]\nepc = "E200"', r"Expected `str` matching regex.*\$\.tag\[0\]\.epc"),
        ('[[tag]]\nepc = "e2001"', r"\$\.tag\[0\]\.epc"),
        ('[[tag]]\nepc = "e200"\nlight = "always"', r"unknown field `light`.*\$\.tag\[0\]"),
        ('[[tag]]\nepc = "e200"\nlit = "sometimes"', r"\$\.tag\[0\]\.lit"),
        ("[reader]\nmissed = 1.5", r"\$\.reader\.missed"),
        ("[reader]\nrange_m = nan", r"\$\.reader\.range_m"),
        ("seed = ", "not TOML"),
    ],
)
def test_wrong_files_name_file_and_key(tmp_path: Path, text: str, message: str):
    file = tmp_path / "scene.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message) as caught:
        read_description(file)
    assert str(caught.value).startswith(f"{file}: ")


def test_two_tags_of_one_name_are_refused(tmp_path: Path):
    file = tmp_path / "scene.toml"
    file.write_text('[[tag]]\nepc = "e200"\n' * 2)
    with pytest.raises(ConfigError, match="two tags are called e200"):
        build(read_description(file), "r1", 0)


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(ConfigError, match="No such file"):
        read_description(tmp_path / "none.toml")
