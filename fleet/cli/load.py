"""`fleet load`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from fleet.load.plan import Load


@click.command()
@click.option(
    "--robots",
    type=click.IntRange(1, 1000),
    help="How many send.  [default: 50; with --from one for each journal]",
)
@click.option(
    "--rate-hz",
    type=click.FloatRange(0.1, 1000.0),
    default=10.0,
    show_default=True,
    help="Keyframes of each robot in a second.",
)
@click.option(
    "--tags",
    type=click.IntRange(3, 20_000),
    help="Under the ceiling of a hall that is as large as they need.  [default: 500]",
)
@click.option(
    "--duration-s",
    type=click.FloatRange(min=1.0),
    default=60.0,
    show_default=True,
    help="How long they send; with --until-it-breaks, at each rate.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Of hall, routes, noise and the moments at which each robot sends.",
)
@click.option(
    "--from",
    "journals",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    metavar="FOLDER",
    help="Send what the journals in FOLDER hold, instead of simulated keyframes.",
)
@click.option(
    "--until-it-breaks",
    is_flag=True,
    help="Faster by a quarter each time, until acknowledgements are late or the queue grows.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def load(
    robots: int | None,
    rate_hz: float,
    tags: int | None,
    duration_s: float,
    seed: int,
    journals: Path | None,
    until_it_breaks: bool,
    as_json: bool,
) -> None:
    """Put load on the real service and measure what it takes.

    Router, service and solver are processes, the database is new, robots are Zenoh sessions of this
    process. Ctrl-C ends it early, and what was measured is shown.
    """
    if journals is not None and tags is not None:
        raise click.UsageError("--tags is of a simulated hall, --from brings its own")
    from fleet.cli.interrupt import ending_early
    from fleet.load import report
    from fleet.load.run import run, run_until_it_breaks

    wanted = _load(robots, rate_hz, tags, duration_s, seed, journals)
    with ending_early() as stopped:
        act = run_until_it_breaks if until_it_breaks else run
        outcome = act(wanted, stopped, lambda line: click.echo(line, err=True))
    if as_json:
        import msgspec

        click.echo(msgspec.json.encode(report.as_contract(wanted, outcome)))
    else:
        report.show(wanted, outcome)


def _load(
    robots: int | None,
    rate_hz: float,
    tags: int | None,
    duration_s: float,
    seed: int,
    journals: Path | None,
) -> "Load":
    from fleet.load.ground import SITE
    from fleet.load.plan import Load
    from fleet.load.recorded import recorded
    from fleet.load.swarm import MOST, SPREAD_M, rovers

    if journals is not None:
        sources = recorded(journals, robots, SITE)
        about: dict[str, object] = {"source": "journals", "tags_hung": None, "seed": seed}
    else:
        sources = [*rovers(seed, robots or 50, tags or 500, SITE, SPREAD_M, MOST)]
        about = {"source": "simulated", "tags_hung": tags or 500, "seed": seed}
    return Load(sources, rate_hz, duration_s, seed, about)
