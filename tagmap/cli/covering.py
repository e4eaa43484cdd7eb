"""`tagmap map coverage`."""

from pathlib import Path
from typing import Any

import click

from tagmap.cli.options import POSITIVE, Number, tags_option
from tagmap.cli.show import show_facts, show_json

UPRIGHT_RAD = 1.571
HIGHEST_M = 1e4


@click.command()
@tags_option
@click.option("--rig", required=True, help="Rig file, or the name of a preset.")
@click.option(
    "--mount-z-m",
    type=Number(min=-HIGHEST_M, max=HIGHEST_M),
    required=True,
    help="Height of the camera in the map.",
)
@click.option(
    "--tilt-rad",
    type=Number(min=-UPRIGHT_RAD, max=UPRIGHT_RAD),
    required=True,
    help="Its axis above level; 1.5708 looks straight up.",
)
@click.option("--cell-m", type=POSITIVE, required=True, help="Side of a cell.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    required=True,
    metavar="STEM",
    help="Names without ending.",
)
@click.option("--worst-m", type=POSITIVE, default=0.1, show_default=True, help="Error drawn black.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def coverage(tags_path: Path, out: Path, worst_m: float, as_json: bool, **options: Any) -> None:
    """Draw how accurate poses will be over the floor, for a robot that looks any way.

    Writes OUT.pgm and OUT.yaml for ROS map_server, and OUT.png where matplotlib is installed.
    """
    from tagmap.cli.coverage_files import cover

    if not out.name:
        raise click.UsageError("--out is empty, expected a name without ending")
    facts = cover(tags_path, out, worst_m, **options)
    if not facts["covered_share"]:
        click.echo(
            "note: no pose anywhere: too few tags in view from this height at this tilt, or all on"
            " one line",
            err=True,
        )
    if as_json:
        show_json(facts)
    else:
        show_facts(facts)
