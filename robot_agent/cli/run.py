"""`robot-agent run`"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tagmap.errors import TagmapError

if TYPE_CHECKING:
    from robot_agent.summary import Summary
    from robot_agent.uplink import Route

ROUTER = "tcp/127.0.0.1:7447"


@click.command()
@click.option(
    "--config",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Devices of the robot that senses: robot.toml.",
)
@click.option(
    "--source",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Instead: an observation journal to replay.",
)
@click.option("--robot", metavar="NAME", help="Name of this robot.  [default: as in --config]")
@click.option(
    "--number",
    metavar="N",
    type=click.IntRange(1, 65535),
    help="Number of this robot, unique at its site, 1 to 65535.  [default: as in --config]",
)
@click.option(
    "--site", metavar="NAME", help="Name of the site.  [default: as in --config, else site]"
)
@click.option(
    "--connect",
    multiple=True,
    metavar="ENDPOINT",
    help=f"Router, repeatable.  [default: {ROUTER}]",
)
@click.option(
    "--zenoh-config",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Zenoh configuration, for TLS and access control.",
)
@click.option(
    "--outbox",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="What is not settled yet; kept from run to run.  [default: ROBOT.outbox.db]",
)
@click.option(
    "--map-cache",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="With --config: where the map is kept for the next start.  [default: ROBOT.map]",
)
@click.option(
    "--speed",
    metavar="X",
    type=click.FloatRange(min=0.0, min_open=True),
    help="Replay X times as fast as recorded.  [default: as fast as acknowledgements allow]",
)
@click.option("--realtime", is_flag=True, help="Replay as fast as recorded, as --speed 1.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
def run(
    config: Path | None,
    source: Path | None,
    robot: str | None,
    number: int | None,
    site: str | None,
    connect: tuple[str, ...],
    zenoh_config: Path | None,
    outbox: Path | None,
    map_cache: Path | None,
    speed: float | None,
    realtime: bool,
    as_json: bool,
) -> None:
    """Run a robot: sense with the devices of --config, or replay a --source, and send what was
    seen to the map service until all of it is settled.

    Survives the loss of devices, router and service. SIGTERM or Ctrl-C end it; what is not settled
    stays in the outbox and goes out when it is started again with the same one.
    """
    from robot_agent.uplink import Route
    from tagmap import logs

    if (config is None) == (source is None):
        raise click.UsageError("expected either --config or --source")
    if realtime and speed is not None:
        raise click.UsageError("--realtime and --speed exclude each other")
    if config is not None and (realtime or speed is not None):
        raise click.UsageError("--realtime and --speed are of a --source")
    if source is not None and (map_cache is not None or robot is None or number is None):
        raise click.UsageError("a --source needs --robot and --number, and has no --map-cache")
    for option, name in (("--robot", robot), ("--site", site)):
        _check_name(option, name)
    route = Route(connect or (() if zenoh_config else (ROUTER,)), zenoh_config)
    logs.configure()

    def report(summary: "Summary") -> None:
        click.echo(summary.json() if as_json else summary.text())

    try:
        if config is not None:
            _sense(config, (robot, number, site), route, outbox, map_cache, report)
        else:
            assert source is not None
            assert robot is not None
            assert number is not None
            pace = 1.0 if realtime else speed
            _replay(source, robot, number, site or "site", route, outbox, pace, report)
    except TagmapError as error:
        click.echo(f"robot-agent: {' '.join(str(error).split())}", err=True)
        sys.exit(1)


def _sense(
    path: Path,
    who: tuple[str | None, int | None, str | None],
    route: "Route",
    outbox: Path | None,
    cache: Path | None,
    report: "Callable[[Summary], None]",
) -> None:
    from msgspec.structs import replace

    from robot_agent.devices.config import read_config
    from robot_agent.robot_process import RobotSetup, run_robot

    config = read_config(path)
    told = dict(zip(("name", "number", "site"), who, strict=True))
    given = {key: value for key, value in told.items() if value is not None}
    config = replace(config, robot=replace(config.robot, **given))
    name = config.robot.name or "robot"
    setup = RobotSetup(
        config,
        path,
        route,
        outbox or Path(f"{name}.outbox.db"),
        cache or Path(f"{name}.map"),
    )
    run_robot(setup, report)


def _replay(
    source: Path,
    robot: str,
    number: int,
    site: str,
    route: "Route",
    outbox: Path | None,
    speed: float | None,
    report: "Callable[[Summary], None]",
) -> None:
    from robot_agent.process import Setup, run_process

    setup = Setup(
        source=source,
        robot=robot,
        number=number,
        site=site,
        route=route,
        outbox=outbox or Path(f"{robot}.outbox.db"),
        speed=speed,
    )
    run_process(setup, report)


def _check_name(option: str, name: str | None) -> None:
    import re

    from tagmap.conventions import NAME

    if name is not None and not re.fullmatch(NAME, name):
        raise click.BadParameter(f"{name!r} does not match {NAME}", param_hint=option)
