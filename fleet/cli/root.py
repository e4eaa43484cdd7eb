"""All commands of `fleet`."""

import click

from fleet.cli.bench import bench
from fleet.cli.demo import demo
from fleet.cli.emulate import emulate
from fleet.cli.emulate_galvo import galvo
from fleet.cli.emulate_world import world
from fleet.cli.load import load
from fleet.cli.replay import replay
from fleet.cli.run import run
from fleet.cli.thesis import thesis
from tagmap import __version__


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="fleet")
def cli() -> None:
    """Simulated and recorded robots, run through the real programs and judged against truth."""


for device in (galvo, world):
    emulate.add_command(device)
for command in (demo, run, replay, emulate, load, bench, thesis):
    cli.add_command(command)
