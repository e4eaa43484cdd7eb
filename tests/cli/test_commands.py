"""Every command has help and a line in docs/cli.md; wrong usage is 2, failure one line and 1."""

import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from tagmap.cli import cli

ROOT = Path(__file__).parents[2]
DOCS = (ROOT / "docs" / "cli.md").read_text()


def commands(group=cli, prefix="tagmap"):
    for name, command in group.commands.items():
        path = f"{prefix} {name}"
        if isinstance(command, click.Group):
            yield from commands(command, path)
        else:
            yield path, command


@pytest.mark.parametrize(("path", "command"), list(commands()))
def test_every_command_has_help_and_a_line_in_the_docs(path, command):
    assert command.help
    assert f"| `{path}" in DOCS
    for option in command.params:
        if isinstance(option, click.Option) and option.name != "as_json":
            assert option.help, option.name
    result = CliRunner().invoke(cli, [*path.split()[1:], "-h"])
    assert result.exit_code == 0


def test_the_docs_name_no_command_that_does_not_exist():
    known = [path for path, _ in commands()]
    rows = [line for line in DOCS.splitlines() if line.startswith("| `tagmap ")]
    assert len(rows) == len(known)


def tagmap(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "tagmap.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=cwd,
        check=False,
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ["nonsense"],
        ["tags", "survey", "6", "1", "2"],
        ["map", "export", "--format", "gif", "--out", "x"],
        ["serve", "--listen", "tcp/127.0.0.1:1", "--connect", "tcp/127.0.0.1:2"],
        ["serve", "--site", "No Name"],
        ["status", "--site", "No Name"],
        ["map", "solve", "--timeout-s", "-1"],
    ],
)
def test_wrong_usage_exits_2(arguments):
    assert CliRunner().invoke(cli, arguments).exit_code == 2


def one_line(result):
    assert result.returncode == 1
    assert len(result.stderr.splitlines()) == 1, result.stderr
    assert result.stderr.startswith("tagmap: ")
    return result.stderr


def test_nobody_there(endpoint):
    assert endpoint in one_line(tagmap("status", "--connect", endpoint))


def test_wrong_survey_file(tmp_path):
    assert "none.csv" in one_line(tagmap("serve", "--survey", tmp_path / "none.csv", cwd=tmp_path))
    path = tmp_path / "survey.csv"
    path.write_text("tag,x_m,y_m,z_m,sigma_m\n6,1,2,3,-1\n")
    assert "survey.csv: line 2: sigma" in one_line(tagmap("serve", "--survey", path, cwd=tmp_path))


def test_wrong_zenoh_config(tmp_path):
    path = tmp_path / "none.json5"
    assert "none.json5" in one_line(tagmap("status", "--zenoh-config", path))


def test_db_check_of_what_is_no_database(tmp_path):
    assert "none.db" in one_line(tagmap("db", "check", tmp_path / "none.db"))
    (tmp_path / "text.db").write_text("not a database, whatever its name says, but some text")
    assert "text.db" in one_line(tagmap("db", "check", tmp_path / "text.db"))
