"""`fleet demo`"""

from pathlib import Path

import click

SCENARIO = "demo"


@click.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="New folder for database, report and logs.  [default: demo-DATE-TIME]",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Of world, routes and noise.",
)
@click.option(
    "--duration-s",
    type=click.FloatRange(min=1.0),
    metavar="S",
    help="How long robots drive.  [default: 100]",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.pass_context
def demo(
    context: click.Context, out: Path | None, seed: int, duration_s: float | None, as_json: bool
) -> None:
    """Three robots that know nothing map a hall of 24 tags, in about two minutes.

    Real agents, real router, real service; emulated are cameras, wheels, lasers and readers, behind
    the sockets of real ones. Four tags are surveyed, so the map is absolute, and robots write it
    into the tags. Ends with the scores and a report. The same as fleet run demo --live.
    """
    from fleet.cli.run import run

    context.invoke(
        run,
        scenario=SCENARIO,
        seed=seed,
        out=out,
        duration_s=duration_s,
        live=True,
        as_json=as_json,
    )
