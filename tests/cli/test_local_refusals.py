"""What localize, dop and map coverage refuse: one line with file, place, and what is expected."""

import json
import re
from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner

from tagmap.cli import cli
from tagmap.errors import TagmapError
from tagmap.records.json_file import LARGEST_BYTES
from tagmap.records.rig_file import find_rig

TAGS = {"a": [0, 1, 0], "b": [0.9, -0.5, 0], "c": [-0.9, -0.5, 0], "d": [0.1, 0.2, 0.4]}
SEEN = {"a": [600, 500], "b": [700, 500], "c": [600, 600], "d": [650, 550]}
VIEW = {"rig": "wide-angle", "tags": TAGS, "left": SEEN, "sigma_px": 0.2}
RIG = msgspec.to_builtins(find_rig("wide-angle"))
AT_ONE_PLACE = {tag: [1, 1, 1] for tag in TAGS}


def refused(*command: str) -> str:
    """The message, which `main` shows in one line; 1 is its exit code."""
    with pytest.raises(TagmapError) as caught:
        CliRunner().invoke(cli, command, catch_exceptions=False)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 300
    return message


def changed(**change: object) -> str:
    return json.dumps(VIEW | change)


WRONG_VIEWS = {
    "nothing": ("", "not JSON: Expecting value in line 1, column 1"),
    "text": ("left", "not JSON: Expecting value in line 1"),
    "bytes": ('"\udcff"', "not UTF-8"),
    "cut off": (changed()[:60], "not JSON: .* in line 1, column"),
    "a list": ("[1, 2]", "Expected `object`, got `array`"),
    "nested": ("[" * 100_000, "nested too deeply"),
    "endless": (" " * (LARGEST_BYTES + 1), "larger than 16 MiB"),
    "NaN": (changed(left=SEEN | {"a": [float("nan"), 1]}), r"left\.a\[0\] is nan, expected a fin"),
    "infinite": (changed(sigma_px=float("inf")), "sigma_px is inf, expected a finite number"),
    "too large": (changed().replace("0.9", "1e999"), r"tags\.b\[0\] is inf"),
    "a tag twice": (changed().replace('"b": [0.9', '"a": [0.9'), "key 'a' is there twice"),
    "a key twice": (changed()[:-1] + ', "sigma_px": 1}', "key 'sigma_px' is there twice"),
    "planar": (changed(tags={"a": [0, 1]}), r"tags: a is \[0, 1\], expected \[x, y, z\] in m"),
    "a text for a number": (changed(left={"a": ["1", 2]}), r"left: a is .*expected \[u, v\] in px"),
    "true for a number": (changed(left={"a": [True, 2]}), r"left: a is .*expected \[u, v\] in px"),
    "no tag id": (changed(left={"A b": [1, 2]}), "left: 'A b' is no tag id"),
    "a tag without place": (changed(left={"x": [1, 2]}), "tag x is seen, but tags do not say"),
    "tags at one place": (changed(tags=AT_ONE_PLACE), "tags: all 4 are at one place"),
    "negative noise": (changed(sigma_px=-1), "sigma_px is -1: Expected `float` >= 1e-09"),
    "no noise": (changed(sigma_px=0), "sigma_px is 0: Expected `float` >= 1e-09"),
    "negative variance": (changed(tag_cov_m2=-1), "tag_cov_m2 is -1: Expected"),
    "a tag's variance alone": (
        changed(tag_cov_m2={"a": 1e-6, "b": [1, 0]}),
        r"tag_cov_m2: a is 1e-06, expected \[xx, xy, xz, yy, yz, zz\] in m\^2",
    ),
    "a misspelt key of a rig": (
        changed(rig=RIG | {"left": RIG["left"] | {"distortion": [0.1, 0, 0, 0, 0]}}),
        "rig: unknown key left.distortion, expected width_px",
    ),
    "a key that no rig has": (changed(rig=RIG | {"sigma": 1}), "rig: unknown key sigma,"),
    "a rig in mm": (
        changed(rig=RIG | {"T_right_left": {"p_m": [-300, 0, 0], "q_wxyz": [1, 0, 0, 0]}}),
        "rig is .*: T_right_left.p_m is a baseline of 300 m, expected 0.001 to 10 m",
    ),
    "another camera": (
        changed(left=SEEN | {"a": [1300, 500]}),
        r"left: a is at \(1300, 500\) px, expected to be within the rig's image of 1280 x 1024 px",
    ),
    "no rig": (changed(rig="none.toml"), r"rig: none\.toml: No such file"),
    "no preset": (changed(rig="fisheye"), "rig: fisheye: no such file, and no preset: thesis"),
    "no name": (changed(rig=""), "rig: an empty name: no such file"),
    "an endless name": (changed(rig="a" * 5000), "rig: aaa.*: no such file"),
    "a broken rig": (changed(rig="broken.toml"), r"rig: .*broken\.toml: not TOML"),
    "half a rig": (changed(rig="half.toml"), r"rig: .*half\.toml: .*missing"),
}


@pytest.mark.parametrize("what", WRONG_VIEWS)
def test_views(what: str, tmp_path: Path):
    text, reason = WRONG_VIEWS[what]
    path = tmp_path / "view.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    (tmp_path / "broken.toml").write_text("[left")
    (tmp_path / "half.toml").write_text("sigma_px = 0.2\n[left]\nwidth_px = 640\n")
    message = refused("localize", str(path))
    assert message.startswith(f"{path}: ")
    assert re.search(reason, message)


def test_views_that_cannot_be_read(tmp_path: Path):
    assert "none.json: No such file" in refused("localize", str(tmp_path / "none.json"))
    assert "Is a directory" in refused("localize", str(tmp_path))


def test_a_wrong_view_from_stdin():
    with pytest.raises(TagmapError, match=r"^stdin: not JSON"):
        CliRunner().invoke(cli, ["localize"], input="{", catch_exceptions=False)


WRONG_TAGS = {
    "a list": ([1], "expected {"),
    "none": ({}, "no tags"),
    "planar": ({"a": [0, 1]}, r"a is \[0, 1\], expected \[x, y, z\] in m"),
    "NaN": ({"a": [float("nan"), 0, 0]}, r"a\[0\] is nan"),
    "beyond any site": ({"a": [1e200, 0, 0]}, "expected"),
    "at one place": (AT_ONE_PLACE, r"all 4 tags are at one place, \[1, 1, 1\] m"),
}
PLACE = ("--camera-position", "0.3,0.2,1.4", "--look-at", "0,0,0")
FLOOR = ("--rig", "wide-angle", "--mount-z-m", "0.5", "--tilt-rad", "1.3", "--cell-m", "0.5")


@pytest.mark.parametrize("what", WRONG_TAGS)
def test_tags(what: str, tmp_path: Path):
    tree, reason = WRONG_TAGS[what]
    path = tmp_path / "tags.json"
    path.write_text(json.dumps(tree))
    options = "--tags", str(path)
    for command in (
        ("dop", *options, *PLACE, "--focal-px", "1425"),
        ("map", "coverage", *options, *FLOOR, "--out", str(tmp_path / "floor")),
    ):
        message = refused(*command)
        assert message.startswith(f"{path}: ")
        assert re.search(reason, message)
    assert list(tmp_path.iterdir()) == [path]


@pytest.fixture
def tags_file(tmp_path: Path) -> str:
    path = tmp_path / "tags.json"
    path.write_text(json.dumps(TAGS))
    return str(path)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ((*PLACE, "--rig", "none.toml"), "none.toml: No such file"),
        (("--camera-position", "1,2,3", "--look-at", "1,2,3", "--focal-px", "9"), "no direction"),
        (("--camera-position", "0,1,0", *PLACE[2:], "--focal-px", "9"), "tag a is at the camera's"),
        (
            (*PLACE, "--focal-px", "9", "--monte-carlo", "1000000000"),
            "1000000000 trials of 4 tags, expected at most 2500000",
        ),
    ],
)
def test_dop(options: tuple[str, ...], reason: str, tags_file: str):
    assert reason in refused("dop", "--tags", tags_file, *options)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("--cell-m", "1e-9"), "cells of 1e-09 m, expected at most 1000000"),
        (("--rig", "none.toml"), "none.toml: No such file"),
        (("--out", "/nowhere/floor"), "/nowhere/floor: cannot be written: No such file"),
    ],
)
def test_coverage(change: tuple[str, ...], reason: str, tags_file: str, tmp_path: Path):
    options = ("--tags", tags_file, *FLOOR, "--out", str(tmp_path / "floor"), *change)
    assert reason in refused("map", "coverage", *options)


def test_coverage_of_two_tags(tmp_path: Path):
    path = tmp_path / "two.json"
    path.write_text(json.dumps({tag: TAGS[tag] for tag in "ab"}))
    command = ("map", "coverage", "--tags", str(path), *FLOOR, "--out", str(tmp_path / "floor"))
    assert "2 tags, expected at least 3" in refused(*command)


@pytest.mark.parametrize(
    "command",
    [
        ("dop", *PLACE),
        ("localize", "--risk", "nan"),
        ("dop", *PLACE, "--focal-px", "-1"),
        ("dop", *PLACE, "--focal-px", "nan"),
        ("dop", *PLACE[2:], "--camera-position", "1,nan,2", "--focal-px", "9"),
        ("dop", *PLACE, "--focal-px", "9", "--sigma-px", "0"),
        ("dop", *PLACE, "--focal-px", "9", "--seed", "-1"),
        ("map", "coverage", *FLOOR, "--cell-m", "0", "--out", "floor"),
        ("map", "coverage", *FLOOR, "--cell-m", "-1", "--out", "floor"),
        ("map", "coverage", *FLOOR, "--cell-m", "nan", "--out", "floor"),
        ("map", "coverage", *FLOOR, "--mount-z-m", "inf", "--out", "floor"),
        ("map", "coverage", *FLOOR, "--tilt-rad", "90", "--out", "floor"),
        ("map", "coverage", *FLOOR, "--worst-m", "0", "--out", "floor"),
        ("map", "coverage", *FLOOR, "--out", ""),
        ("map", "coverage", *FLOOR, "--out", "/"),
    ],
)
def test_wrong_usage_is_2(command: tuple[str, ...], tags_file: str):
    tags = () if command[0] == "localize" else ("--tags", tags_file)
    result = CliRunner().invoke(cli, [*command, *tags])
    assert result.exit_code == 2
    assert "Error: " in result.output


def test_figures_that_do_not_exist_are_explained(tmp_path: Path):
    path = tmp_path / "tags.json"
    options = ("--tags", str(path), *PLACE, "--focal-px", "1425", "--json")
    path.write_text(json.dumps({"a": [0, 0, 0], "b": [1, 0, 0], "c": [2, 0, 0]}))
    line = CliRunner().invoke(cli, ["dop", *options])
    assert "note: no pose from here: the tags are on one line" in line.stderr
    path.write_text(json.dumps({"a": [0, 0, 9], "b": [1, 0, 9], "c": [0, 1, 9]}))
    behind = CliRunner().invoke(cli, ["dop", *options])
    assert "note: 0 of 3 tags are in front of the camera, expected 3" in behind.stderr
    assert set(json.loads(behind.stdout).values()) == {None}
