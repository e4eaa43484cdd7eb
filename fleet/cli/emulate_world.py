"""`fleet emulate world`"""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from fleet.cli.emulating import for_a_time, stay

if TYPE_CHECKING:
    from fleet.emulation.robot.emulators import Device
    from fleet.emulation.world import WorldEmulators

SITE_NUMBER = click.IntRange(1, 65535)
DEVICES = ("cameras", "odometry", "laser", "rfid", "pan-tilt")


@click.command()
@click.argument("scenario")
@click.option(
    "--out",
    required=True,
    metavar="FOLDER",
    type=click.Path(path_type=Path, file_okay=False),
    help="Takes FOLDER/ROBOT/robot.toml of every robot, and survey.csv.",
)
@click.option("--robot", "robots", multiple=True, metavar="NAME", help="Only this one; repeatable.")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    metavar="N",
    help="Of all that is random.  [default: as in the scenario]",
)
@click.option(
    "--site", default="site", show_default=True, metavar="NAME", help="Which site they are at."
)
@click.option(
    "--site-number",
    type=SITE_NUMBER,
    default=1,
    show_default=True,
    metavar="N",
    help="Marks the site's records in tags, as that of `tagmap serve`.",
)
@click.option(
    "--memory",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where tags keep what is written, from run to run, as JSON.",
)
@click.option(
    "--away",
    "outages",
    type=(str, click.Choice(DEVICES), click.FloatRange(min=0.0), click.FloatRange(min=0.0)),
    multiple=True,
    metavar="ROBOT DEVICE FROM_S FOR_S",
    help="This device is away from FROM_S after the start on, for FOR_S; repeatable. DEVICE is one"
    f" of {', '.join(DEVICES)}.",
)
@click.option("--stand", is_flag=True, help="Robots stay where they start.")
@click.option(
    "--baud",
    type=click.IntRange(600, 115200),
    default=9600,
    show_default=True,
    metavar="N",
    help="Speed of the pan-tilt units' lines.",
)
@for_a_time
def world(
    scenario: str,
    out: Path,
    robots: tuple[str, ...],
    seed: int | None,
    site: str,
    site_number: int,
    memory: Path | None,
    outages: tuple[tuple[str, "Device", float, float], ...],
    stand: bool,
    baud: int,
    duration_s: float | None,
) -> None:
    """All devices of the robots of SCENARIO, a file or one that comes along, until Ctrl-C. Prints
    where each robot's robot.toml is, and where its devices listen.

    True time: robots drive for as long as the scenario says, or for --duration-s.
    """
    import re
    import time

    from fleet.cli.interrupt import interruptible
    from fleet.emulation.robot.files import Site
    from fleet.emulation.robot.outage import Outage
    from fleet.emulation.world import WorldEmulators, in_true_time
    from fleet.simulation.scenario.reading import read_scenario
    from fleet.simulation.scene.keeping import KeptMemories
    from fleet.simulation.world.build import build_world
    from tagmap.conventions import NAME

    if not re.fullmatch(NAME, site):
        raise click.BadParameter(f"{site!r} does not match {NAME}", param_hint="--site")
    with interruptible():
        plan = in_true_time(read_scenario(scenario), duration_s, stand=stand)
        built = build_world(plan, plan.seed if seed is None else seed, time.time_ns())
        kept = KeptMemories(built.scene, memory) if memory else None
        away = [Outage(*one) for one in outages]
        with WorldEmulators(built, out, Site(site, site_number), robots, baud, away) as running:
            _tell(running, len(built.scene.tags))
            stay(duration_s, kept)


def _tell(running: "WorldEmulators", tags: int) -> None:
    for robot in running.robots.values():
        ports = robot.ports
        where = [
            f"cameras {ports.cameras}",
            f"odometry {ports.odometry}",
            f"laser {ports.laser}",
            f"rfid {ports.rfid}",
        ]
        if robot.terminal is not None:
            where.append(f"pan-tilt {robot.terminal}")
        click.echo(f"{robot.name}: {robot.config}: {', '.join(where)}")
    click.echo(f"{tags} tags around; what was surveyed of them: {running.survey}")
