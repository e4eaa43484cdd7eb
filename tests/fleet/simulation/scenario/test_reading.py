"""Scenarios as files: complete defaults, and errors that say what is wrong and where."""

from pathlib import Path

import pytest

from fleet.simulation.scenario.reading import keys, library, read_scenario
from tagmap.errors import ConfigError

ROOT = Path(__file__).parents[4]
TAGS = "[[tags.grid]]\ncolumns = 3\nrows = 2\n"


@pytest.fixture
def written(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "my-hall.toml"
        path.write_text(text)
        return path

    return write


def test_three_lines_are_a_scenario(written):
    scenario = read_scenario(written(TAGS))
    assert scenario.name == "my-hall"
    assert scenario.robot_names() == ("r1",)
    assert scenario.rooms()[0].size_m == (20.0, 12.0, 3.2)


@pytest.mark.parametrize("name", library())
def test_the_library_reads(name):
    scenario = read_scenario(name)
    assert scenario.name == name
    assert scenario.about
    assert scenario == read_scenario(ROOT / "fleet" / "scenarios" / f"{name}.toml")


def test_the_library_is_complete():
    expected = "hall-small warehouse thesis-lab grid-ceiling corridor moved-tags merge kidnapped"
    assert {*expected.split(), "bad-survey", "chaos"} <= set(library())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("dration_s = 3\n" + TAGS, "unknown key dration_s, expected about, air, building"),
        (TAGS + "depth = 3\n", "unknown key tags.grid.depth, expected columns, drop_m"),
        (TAGS + "[air]\nmissed = 2.0\n", "Expected `float` <= 1.0 - at `$.air.missed`"),
        ("[survey]\ntags = 'corners'\n", "tags"),
        ("[tags]\n", "expected tag, grid or scatter in it"),
        (TAGS + "[[event]]\nat_s = 1\nkind = 'swapped'\ntags = [1]\n", "1 tags, expected two"),
        (TAGS + "[[event]]\nat_s = 1\nkind = 'moved'\ntags = [1]\n", "either to_m or by_m"),
        (TAGS + "[[event]]\nat_s = 1\nkind = 'kidnapped'\nrobot = 'r1'\n", "to_m is missing"),
        (TAGS + "[[event]]\nat_s = 1\nkind = 'dead'\nrobot = 'r1'\n", "expected tags and no robot"),
        (TAGS + "[[fault]]\nat_s = 1\nkind = 'kill-agent'\n", "expected the name of a robot"),
        (TAGS + "[[fault]]\nat_s = 1\nkind = 'heal'\ntarget = 'r7'\n", "expected one of r1"),
        (TAGS + "[[robot]]\n[[robot]]\nname = 'r1'\n", "two have the name r1"),
        (TAGS + "[[robot]]\nroute.area_m = [3, 0, 1, 4]\n", "least x, least y, most x, most y"),
        (TAGS + "[building]\nmesh = 'a.ply'\nroom = [{}]\n", "mesh excludes room"),
        ("tags = [", "not TOML"),
    ],
)
def test_errors_name_file_key_and_expectation(written, text, said):
    path = written(text)
    with pytest.raises(ConfigError) as raised:
        read_scenario(path)
    assert str(path) in str(raised.value)
    assert said in str(raised.value)


def test_what_there_is_not_is_named():
    with pytest.raises(ConfigError, match=r"no scenario: .*hall-small"):
        read_scenario("hall-large")


def test_files_are_looked_for_beside_the_scenario(written, tmp_path):
    (tmp_path / "mine.toml").write_text("")
    (tmp_path / "hall.ply").write_text("")
    text = TAGS + '[building]\nmesh = "hall.ply"\n[[robot]]\nrig = "mine.toml"\n[[robot]]\n'
    scenario = read_scenario(written(text))
    assert scenario.building.mesh == str(tmp_path / "hall.ply")
    assert [robot.rig for robot in scenario.robot] == [str(tmp_path / "mine.toml"), "wide-angle"]


def test_every_key_is_in_the_docs():
    page = (ROOT / "docs" / "scenarios.md").read_text()
    missing = [key for key in keys() if f"`{key.split('.')[-1]}`" not in page]
    assert missing == []
    tables = {key.rsplit(".", 1)[0] for key in keys() if "." in key}
    assert [table for table in sorted(tables) if f"{table}]" not in page] == []


def test_every_scenario_is_in_the_docs():
    page = (ROOT / "docs" / "scenarios.md").read_text()
    assert [name for name in library() if f"`{name}`" not in page] == []
