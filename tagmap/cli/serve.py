"""`tagmap serve`."""

from pathlib import Path

import click

from tagmap.cli.options import ENDPOINT, site_option


@click.command()
@click.option("--listen", metavar="ENDPOINT", help=f"Start a router here. [default: {ENDPOINT}]")
@click.option("--connect", multiple=True, metavar="ENDPOINT", help="Use this router; repeatable.")
@click.option(
    "--zenoh-config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Zenoh client configuration, for TLS and access control.",
)
@site_option
@click.option(
    "--db",
    type=click.Path(path_type=Path),
    default=Path("site.db"),
    show_default=True,
    help="Database of the site; made if it does not exist.",
)
@click.option(
    "--survey",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Surveyed tags: CSV with the header tag,x_m,y_m,z_m,sigma_m (z is ignored in the plane).",
)
@click.option(
    "--site-number",
    type=click.IntRange(1, 65535),
    metavar="N",
    help="Number of the site in the tags' memories; without it none are written.",
)
@click.option(
    "--memory-key",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Sign what is written in tags with this file's content, 16 bytes or more.",
)
@click.option(
    "--keep-keyframes",
    type=click.IntRange(min=0),
    default=1_000_000,
    show_default=True,
    metavar="N",
    help="Once there are more, the oldest condensed ones leave the database; 0: all stay.",
)
@click.option(
    "--keep-versions",
    type=click.IntRange(min=0),
    default=1000,
    show_default=True,
    metavar="N",
    help="Newest map versions that keep their tags; 0: all do.",
)
def serve(
    listen: str | None,
    connect: tuple[str, ...],
    zenoh_config: Path | None,
    site: str,
    db: Path,
    survey: Path | None,
    site_number: int | None,
    memory_key: Path | None,
    keep_keyframes: int,
    keep_versions: int,
) -> None:
    """Run the map service until SIGTERM or Ctrl-C.

    Starts a router on the loopback interface, unless --connect or --zenoh-config name others.
    """
    if listen and (connect or zenoh_config):
        raise click.UsageError("--listen starts a router; --connect and --zenoh-config use others")
    from tagmap.exchange.survey_csv import read_surveys

    surveys = read_surveys(survey) if survey else []
    from tagmap.memory.key_file import read_key
    from tagmap.service.run import Settings, run
    from tagmap.store import Keep
    from tagmap.writeback.wanted import Owner

    if not connect and zenoh_config is None:
        listen = listen or ENDPOINT
    owner = Owner(site_number, read_key(memory_key) if memory_key else None)
    keep = Keep(keep_keyframes or None, keep_versions or None)
    run(Settings(site, db, listen, connect, zenoh_config, surveys, owner, keep))
