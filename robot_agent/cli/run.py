"""`robot-agent run`"""

import sys
from pathlib import Path

import click

from tagmap.errors import TagmapError

ROUTER = "tcp/127.0.0.1:7447"


@click.command()
@click.option(
    "--source",
    required=True,
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Observation journal to replay.",
)
@click.option("--robot", required=True, metavar="NAME", help="Name of this robot.")
@click.option(
    "--number",
    required=True,
    metavar="N",
    type=click.IntRange(1, 65535),
    help="Number of this robot, unique at its site, 1 to 65535.",
)
@click.option("--site", default="site", show_default=True, metavar="NAME", help="Name of the site.")
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
    "--speed",
    metavar="X",
    type=click.FloatRange(min=0.0, min_open=True),
    help="Replay X times as fast as recorded.  [default: as fast as acknowledgements allow]",
)
@click.option("--realtime", is_flag=True, help="Replay as fast as recorded, as --speed 1.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
def run(
    source: Path,
    robot: str,
    number: int,
    site: str,
    connect: tuple[str, ...],
    zenoh_config: Path | None,
    outbox: Path | None,
    speed: float | None,
    realtime: bool,
    as_json: bool,
) -> None:
    """Send a robot's observations to the map service until all of them are settled.

    Survives the loss of router and service, and resumes where it was when it is started again with
    the same outbox. SIGTERM or Ctrl-C end it early; what is not settled stays in the outbox.
    """
    from robot_agent.process import Setup, run_process
    from robot_agent.uplink import Route
    from tagmap import logs

    if realtime and speed is not None:
        raise click.UsageError("--realtime and --speed exclude each other")
    for option, name in (("--robot", robot), ("--site", site)):
        _check_name(option, name)
    setup = Setup(
        source=source,
        robot=robot,
        number=number,
        site=site,
        route=Route(connect or (() if zenoh_config else (ROUTER,)), zenoh_config),
        outbox=outbox or Path(f"{robot}.outbox.db"),
        speed=1.0 if realtime else speed,
    )
    logs.configure()
    try:
        run_process(
            setup, lambda summary: click.echo(summary.json() if as_json else summary.text())
        )
    except TagmapError as error:
        click.echo(f"robot-agent: {' '.join(str(error).split())}", err=True)
        sys.exit(1)


def _check_name(option: str, name: str) -> None:
    import re

    from tagmap.conventions import NAME

    if not re.fullmatch(NAME, name):
        raise click.BadParameter(f"{name!r} does not match {NAME}", param_hint=option)
