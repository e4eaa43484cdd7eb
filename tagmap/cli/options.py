"""Options that the client commands share."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import click

ENDPOINT = "tcp/127.0.0.1:7447"


class Number(click.FloatRange):
    """A finite number of a size that a site has, SI or px."""

    largest = 1e12

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number = float(super().convert(value, param, ctx))
        if not abs(number) <= self.largest:
            self.fail(f"{value} is not a finite number up to {self.largest:g}", param, ctx)
        return number


POSITIVE = Number(min=0.0, min_open=True)
SIGMA = Number(min=1e-9)

tags_option = click.option(
    "--tags",
    "tags_path",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help='JSON, {"id": [x, y, z], ...} in m.',
)


@dataclass(frozen=True, slots=True)
class Target:
    """Which service to ask, and how to show the answer."""

    site: str
    connect: tuple[str, ...]
    zenoh_config: Path | None
    as_json: bool


def _check_name(_context: click.Context, _option: click.Parameter, name: str) -> str:
    import re

    from tagmap.conventions import NAME

    if not re.fullmatch(NAME, name):
        raise click.BadParameter(f"{name!r} does not match {NAME}")
    return name


site_option = click.option(
    "--site", default="site", show_default=True, callback=_check_name, help="Name of the site."
)


def client(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command --connect, --zenoh-config, --site and --json as one `target`."""

    @click.option(
        "--connect",
        multiple=True,
        metavar="ENDPOINT",
        help=f"Router to connect to; repeatable. [default: {ENDPOINT}]",
    )
    @click.option(
        "--zenoh-config",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Zenoh configuration, for TLS and access control.",
    )
    @site_option
    @click.option("--json", "as_json", is_flag=True, help="Print JSON.")
    @wraps(function)
    def command(
        connect: tuple[str, ...],
        zenoh_config: Path | None,
        site: str,
        as_json: bool,
        **rest: Any,
    ) -> None:
        endpoints = connect if connect or zenoh_config else (ENDPOINT,)
        function(target=Target(site, endpoints, zenoh_config, as_json), **rest)

    return command
