"""docs/cli.md names every command of the robot's and the harness's programs, and no other."""

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from fleet.cli.root import cli as fleet
from robot_agent.cli import main as robot_agent

DOCS = (Path(__file__).parents[1] / "docs" / "cli.md").read_text()
PROGRAMS: dict[str, click.Group] = {"robot-agent": robot_agent, "fleet": fleet}


def commands(group: click.Group, prefix: str) -> Iterator[str]:
    for name, command in group.commands.items():
        path = f"{prefix} {name}"
        # A replay of one format is an option as much as a command: its page lists them.
        if isinstance(command, click.Group) and name != "replay":
            yield from commands(command, path)
        else:
            yield path


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_command_has_a_line(program: str):
    listed = re.findall(rf"^\| `({program} [^`A-Z\[]*)", DOCS, re.MULTILINE)
    assert sorted(map(str.strip, listed)) == sorted(commands(PROGRAMS[program], program))
