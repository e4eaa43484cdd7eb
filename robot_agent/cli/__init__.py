"""`robot-agent`: one process per robot. Heavy imports happen inside commands."""

import click

from robot_agent.cli.calibrate import calibrate
from robot_agent.cli.check import check
from robot_agent.cli.detect import detect
from robot_agent.cli.run import run
from robot_agent.cli.tag import tag


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def main() -> None:
    """Measure where tags are and have it settled by the map service."""


main.add_command(run)
main.add_command(detect)
main.add_command(calibrate)
main.add_command(check)
main.add_command(tag)
