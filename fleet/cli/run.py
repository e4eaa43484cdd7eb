"""`fleet run`"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from fleet.evaluation.scores.contract import Scores
    from fleet.evaluation.scores.evidence import Evidence
    from fleet.simulation.scenario.description import Scenario
    from fleet.simulation.world.world import World


@click.command()
@click.argument("scenario", required=False)
@click.option("--list", "as_list", is_flag=True, help="Name the scenarios that come along.")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help="Of world, routes and noise.  [default: that of the scenario]",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="New folder for database, report and logs.  [default: SCENARIO-DATE-TIME]",
)
@click.option(
    "--duration-s",
    type=click.FloatRange(min=1.0),
    metavar="S",
    help="End after S seconds of the world.  [default: as long as the scenario is]",
)
@click.option("--exact", is_flag=True, help="Without the hidden errors of calibrations.")
@click.option(
    "--chaos",
    type=click.IntRange(min=0),
    metavar="SEED",
    help="Add faults drawn from SEED.",
)
@click.option("--live", is_flag=True, help="In true time: real programs, sockets and Zenoh.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def run(
    scenario: str | None,
    as_list: bool,
    seed: int | None,
    out: Path | None,
    duration_s: float | None,
    exact: bool,
    chaos: int | None,
    live: bool,
    as_json: bool,
) -> None:
    """Play SCENARIO, a file or one of --list, and score it against the truth.

    In virtual time: world, agents, router and service in one process, bit for bit the same for a
    seed. With --live as processes of their own, in true time. Ctrl-C ends it early, and what was
    played is scored.
    """
    if as_list:
        _list()
        return
    if scenario is None:
        raise click.UsageError("expected a scenario, or --list")
    from fleet.running.one_thread import one_thread

    one_thread()
    import time

    from fleet.evaluation.scores.scoring import find, score
    from fleet.running.extras import demand
    from fleet.running.folder import new_folder
    from fleet.virtual.run import SITE_NUMBER

    chosen = _scenario(scenario, duration_s, exact, chaos)
    demand(chosen, live)
    seed, name = chosen.seed if seed is None else seed, chosen.name
    folder = new_folder(out or Path(time.strftime(f"{name}-%Y%m%d-%H%M%S"))).absolute()
    click.echo(f"{name}, seed {seed}: in {folder.name}", err=True)
    with _named(scenario, folder):
        evidence = _played(chosen, seed, folder, live)
    click.echo("judging", err=True)
    findings = find(evidence, SITE_NUMBER)
    report = folder / "report.html"
    scores = score(findings, str(report))
    _write(report, findings, scores)
    (folder / "scores.json").write_text(scores.json() + "\n")
    if as_json:
        click.echo(scores.json())
    else:
        _show(scores)


def _list() -> None:
    from fleet.simulation.scenario.reading import library, read_scenario

    for name in library():
        click.echo(f"{name:14}{read_scenario(name).about}")


def _scenario(source: str, duration_s: float | None, exact: bool, chaos: int | None) -> "Scenario":
    from msgspec.structs import replace

    from fleet.simulation.scenario.chaos import with_chaos
    from fleet.simulation.scenario.reading import read_scenario

    scenario = read_scenario(source)
    if duration_s is not None:
        scenario = replace(scenario, duration_s=duration_s)
    if exact:
        scenario = replace(scenario, calibration=replace(scenario.calibration, exact=True))
    return scenario if chaos is None else with_chaos(scenario, chaos)


def _played(scenario: "Scenario", seed: int, folder: Path, live: bool) -> "Evidence":
    from fleet.cli.interrupt import ending_early
    from fleet.cli.live import played_live
    from fleet.running.scenario import START_NS, play_scenario
    from fleet.simulation.world.build import build_world

    with ending_early() as stopped:
        if live:
            return played_live(scenario, seed, folder, stopped)
        world = build_world(scenario, seed, START_NS)
        with _progress(world) as tell:
            return play_scenario(world, folder, tell, stopped)


@contextmanager
def _named(source: str, folder: Path) -> Iterator[None]:
    """What is wrong with a scenario is said with its name, and leaves no empty folder."""
    from tagmap.errors import ConfigError

    try:
        yield
    except ConfigError as error:
        with suppress(OSError):
            folder.rmdir()
        raise ConfigError(f"{source}: {error}") from None


@contextmanager
def _progress(world: "World") -> Iterator[Callable[[int], None]]:
    from fleet.running.progress import Clocked

    with Clocked(world.start_ns, world.end_ns, lambda line: click.echo(line, err=True)) as clocked:
        yield clocked.show


def _write(report: Path, findings: object, scores: "Scores") -> None:
    from fleet.evaluation.scores.pictures import draw
    from fleet.evaluation.scores.report import write_report
    from fleet.evaluation.scores.scoring import Findings

    assert isinstance(findings, Findings)
    try:
        pictures = draw(findings, report.parent)
    except ImportError:
        click.echo("no pictures: matplotlib is not installed, see tagmap[plot]", err=True)
        pictures = []
    write_report(findings, scores, pictures, report)


def _show(scores: "Scores") -> None:
    from tagmap.cli.show import show_facts

    bands = {
        name: " to ".join(f"{bound:.4f}" for bound in value)
        for name, value in scores.fields().items()
        if isinstance(value, tuple)
    }
    show_facts(scores.fields() | bands)
