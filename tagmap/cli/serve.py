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
def serve(
    listen: str | None,
    connect: tuple[str, ...],
    zenoh_config: Path | None,
    site: str,
    db: Path,
    survey: Path | None,
) -> None:
    """Run the map service until SIGTERM or Ctrl-C.

    Starts a router on the loopback interface, unless --connect or --zenoh-config name others.
    """
    if listen and (connect or zenoh_config):
        raise click.UsageError("--listen starts a router; --connect and --zenoh-config use others")
    from tagmap.exchange.survey_csv import read_surveys

    surveys = read_surveys(survey) if survey else []
    from tagmap.service.run import Settings, run

    if not connect and zenoh_config is None:
        listen = listen or ENDPOINT
    run(Settings(site, db, listen, connect, zenoh_config, surveys))
