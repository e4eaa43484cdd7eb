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
@click.argument("file", type=click.Path(path_type=Path), required=False)
@click.option("--out", type=click.Path(path_type=Path), help="FILE only: write the result as g2o.")
@click.option(
    "--start",
    type=click.Choice(["file", "nothing"]),
    help="FILE only: where to begin. [default: the file's vertices, nothing if it has none]",
)
@click.option("--robust", is_flag=True, help="FILE only: reject landmark edges that do not fit.")
@click.option(
    "--timeout-s",
    type=click.FloatRange(min=0.0, min_open=True),
    default=600.0,
    show_default=True,
    help="Without FILE: how long to wait.",
)
@click.option(
    "--from-nothing", is_flag=True, help="Without FILE: from all keyframes, old ones too."
)
@client
def solve(
    target: Target,
    file: Path | None,
    out: Path | None,
    start: str | None,
    robust: bool,
    timeout_s: float,
    from_nothing: bool,
) -> None:
    """Take everything the service has stored so far into the map, or solve the graph in FILE.

    Without FILE: have the running service do it, wait for it, and show the summary.

    FILE is a graph in g2o or ODOMETRY/LANDMARK form, plain or .xz; no service is needed.
    """
    if file is not None:
        if from_nothing:
            raise click.UsageError("--from-nothing does not go with FILE; see --start")
        _solve_file(target, file, out, start, robust)
    elif out is not None or start is not None or robust:
        raise click.UsageError("--out, --start and --robust need a FILE")
    else:
        _solve_stored(target, timeout_s, from_nothing)


def _solve_file(
    target: Target, file: Path, out: Path | None, start: str | None, robust: bool
) -> None:
    import time

    began_s = time.perf_counter()
    from tagmap.cli.solving import Wanted, solve_file

    summary, rejected = solve_file(Wanted(file, out, start, robust), began_s)
    if target.as_json:
        show_json(summary)
    else:
        show_facts(summary | ({"rejected": rejected} if robust else {}))


def _solve_stored(target: Target, timeout_s: float, from_nothing: bool) -> None:
    data = ask(target, "map", "solve", timeout_s=timeout_s, from_nothing=from_nothing or None)
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
    type=click.Choice(["json", "csv", "tum", "g2o"]),
    required=True,
    help="See below.",
)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Where to write.")
@click.option("--robot", help="Only this robot's trajectory (json, tum).")
@click.option(
    "--db",
    type=click.Path(path_type=Path),
    help="The database to read (g2o, which asks no service). [default: site.db]",
)
@client
def export(target: Target, format_: str, out: Path, robot: str | None, db: Path | None) -> None:
    """Write the newest map to files.

    \b
    json  one file: version, tags, and every robot's trajectory
    csv   one file: the tags
    tum   trajectories, t x y z qx qy qz qw: with --robot one file, else a folder with ROBOT.tum
    g2o   one file: poses, tags, odometry and sightings as a graph, read from the database
    """
    if format_ == "g2o" and robot is not None:
        raise click.UsageError("--robot does not go with --format g2o")
    if format_ != "g2o" and db is not None:
        raise click.UsageError(f"--db does not go with --format {format_}")
    written = _export(target, format_, out, robot, db)
    if target.as_json:
        show_json(written)
    else:
        click.echo(f"{written['tags']} tags, {written['poses']} poses written to {out}")
        if written.get("skipped"):
            click.echo(f"{written['skipped']} sightings left out: they give no point")


def _export(
    target: Target, format_: str, out: Path, robot: str | None, db: Path | None
) -> dict[str, Any]:
    if format_ == "g2o":
        from tagmap.cli.exporting_graph import export_graph

        return export_graph(db or Path("site.db"), out)
    from tagmap.cli.exporting import export_map

    return export_map(target, format_, out, robot)


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
