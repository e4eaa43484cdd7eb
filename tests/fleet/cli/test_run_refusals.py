"""A scenario that cannot be played is refused with its name, the key and what is expected."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from fleet.cli.root import cli

GRID = "[[tags.grid]]\ncolumns = 4\nrows = 3\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[[tags.tag]]\np_m = [30, 1, 3]\n", r"tags.tag[0].p_m: [30.0, 1.0, 3.0] is outside"),
        ('[building]\nmesh = "nowhere.ply"\n' + GRID, "building.mesh"),
        (GRID + "[survey]\ntags = [1, 99]\n", "survey.tags: tag 99, expected 1 to 12"),
        ("[[tags.grid]\n", "not TOML"),
        (GRID + "[[robot]]\nnumbr = 2\n", "unknown key robot.numbr, expected"),
    ],
)
def test_named_and_nothing_is_left(tmp_path: Path, text: str, expected: str):
    file, out = tmp_path / "mine.toml", tmp_path / "run"
    file.write_text(text)
    done = CliRunner().invoke(cli, ["run", str(file), "--out", str(out)])
    assert "mine.toml: " in str(done.exception)
    assert expected in str(done.exception)
    assert not out.exists()
