"""`tagmap map`: solve, versions, export."""

from pathlib import Path
from typing import Any

import click

from tagmap.cli.ask import ask
from tagmap.cli.options import Target, client
from tagmap.cli.show import show_facts, show_json, show_table, time_of

REPORTED = 40


@click.group("map")
def map_() -> None:
    """The map and its versions."""


@map_.command()
@click.option(
    "--timeout-s",
    type=click.FloatRange(min=0.0, min_open=True),
    default=600.0,
    show_default=True,
    help="How long to wait.",
)
@client
def solve(target: Target, timeout_s: float) -> None:
    """Solve over everything stored so far, wait for it, and show the summary."""
    data = ask(target, "map", "solve", timeout_s=timeout_s)
    if target.as_json:
        show_json(data)
        return
    summary = data.pop("summary") or {}
    report = summary.pop("report", [])
    told = {"at": time_of(data["t_ns"]), **data, **summary}
    hidden = ("v", "t_ns", "moved", "facts", "ends")
    show_facts({name: value for name, value in told.items() if name not in hidden})
    for line in report[:REPORTED]:
        click.echo(f"report: {line}")
    if len(report) > REPORTED:
        click.echo(f"report: and {len(report) - REPORTED} lines more, all of them with --json")


@map_.command()
@client
def versions(target: Target) -> None:
    """List map versions: when, why, and how far each moved the map."""
    data = ask(target, "map", "versions")
    if target.as_json:
        show_json(data)
        return
    columns = ["version", "at", "cause", "gauge", "tags", "withheld", "moved_m", "turned_rad"]
    show_table("map versions", columns, map(_row, data["versions"]))


@map_.command()
@click.option(
    "--format",
    "format_",
    type=click.Choice(["json", "csv", "tum"]),
    required=True,
    help="See below.",
)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Where to write.")
@click.option("--robot", help="Only this robot's trajectory (json, tum).")
@client
def export(target: Target, format_: str, out: Path, robot: str | None) -> None:
    """Write the newest map to files.

    \b
    json  one file: version, tags, and every robot's trajectory
    csv   one file: the tags
    tum   trajectories, t x y z qx qy qz qw: with --robot one file, else a folder with ROBOT.tum
    """
    from tagmap.cli.exporting import export_map

    written = export_map(target, format_, out, robot)
    if target.as_json:
        show_json(written)
    else:
        click.echo(f"{written['tags']} tags, {written['poses']} poses written to {out}")


def _row(version: dict[str, Any]) -> list[Any]:
    import math

    moved = version["moved"]
    turned = None
    if moved and "theta_rad" in moved:
        turned = abs(moved["theta_rad"])
    elif moved:
        turned = 2.0 * math.atan2(math.hypot(*moved["q_wxyz"][1:]), abs(moved["q_wxyz"][0]))
    return [
        version["version"],
        time_of(version["t_ns"]),
        version["cause"],
        version["gauge"],
        version["tags"],
        version["withheld"],
        math.hypot(*moved["p_m"]) if moved else None,
        turned,
    ]
