"""All commands of `tagmap`."""

import click

from tagmap import __version__
from tagmap.cli.covering import coverage
from tagmap.cli.database import db
from tagmap.cli.localise import localize
from tagmap.cli.maps import map_
from tagmap.cli.precision import dop
from tagmap.cli.robots import robots
from tagmap.cli.schemas import schema
from tagmap.cli.serve import serve
from tagmap.cli.status import status
from tagmap.cli.tags import tags


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="tagmap")
def cli() -> None:
    """Absolute positions for indoor robots: the map service and its administration."""


for command in (serve, status, schema, tags, robots, map_, localize, dop, db):
    cli.add_command(command)
map_.add_command(coverage)
