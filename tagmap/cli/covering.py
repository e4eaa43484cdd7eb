"""`tagmap map coverage`."""

from pathlib import Path
from typing import Any

import click

from tagmap.cli.show import show_facts, show_json

POSITIVE = click.FloatRange(min=0.0, min_open=True)


@click.command()
@click.option(
    "--tags",
    "tags_path",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help='JSON, {"id": [x, y, z], ...} in m.',
)
@click.option("--rig", required=True, help="Rig file, or the name of a preset.")
@click.option("--mount-z-m", type=float, required=True, help="Height of the camera in the map.")
@click.option(
    "--tilt-rad", type=float, required=True, help="Its axis above level; 1.5708 looks straight up."
)
@click.option("--cell-m", type=POSITIVE, required=True, help="Side of a cell.")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Names without ending.")
@click.option("--worst-m", type=POSITIVE, default=0.1, show_default=True, help="Error drawn black.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def coverage(tags_path: Path, out: Path, worst_m: float, as_json: bool, **options: Any) -> None:
    """Draw how accurate poses will be over the floor, for a robot that looks any way.

    Writes OUT.pgm and OUT.yaml for ROS map_server, and OUT.png where matplotlib is installed.
    """
    from tagmap.cli.coverage_files import cover

    facts = cover(tags_path, out, worst_m, **options)
    if as_json:
        show_json(facts)
    else:
        show_facts(facts)
