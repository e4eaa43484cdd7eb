"""`tagmap dop`."""

from pathlib import Path
from typing import Any

import click

from tagmap.cli.options import POSITIVE, SIGMA, Number, tags_option
from tagmap.cli.show import show_facts, show_json


def _triple(_: click.Context, __: click.Parameter, value: str) -> tuple[float, ...]:
    try:
        numbers = tuple(map(float, value.split(",")))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(abs(x) <= Number.largest for x in numbers):
        raise click.BadParameter(f"{value!r} is not X,Y,Z in m")
    return numbers


@click.command()
@tags_option
@click.option(
    "--camera-position",
    callback=_triple,
    metavar="X,Y,Z",
    required=True,
    help="Of the (left) camera, m.",
)
@click.option(
    "--look-at", callback=_triple, metavar="X,Y,Z", required=True, help="A point on its axis, m."
)
@click.option("--focal-px", type=POSITIVE, help="Focal length.")
@click.option("--rig", help="Rig file or preset: a stereo pair. Its focal lengths by default.")
@click.option(
    "--monte-carlo",
    "trials",
    type=click.IntRange(min=2),
    metavar="N",
    help="Also try: N noisy views.",
)
@click.option(
    "--sigma-px", type=SIGMA, default=0.02, show_default=True, help="Pixel noise of the trials."
)
@click.option(
    "--sigma-tag-m", type=SIGMA, default=2e-5, show_default=True, help="Tag noise of the trials."
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the trials."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def dop(tags_path: Path, as_json: bool, **options: Any) -> None:
    """By how much a place multiplies errors of tags and of pixels.

    All tags count as seen wherever they are in front of the camera; lenses are ideal. Near the
    danger cylinder only trials with the noise that you have tell the truth.
    """
    from tagmap.cli.diluting import dilution
    from tagmap.exchange.tags_json import read_tags_json

    if options["focal_px"] is None and options["rig"] is None:
        raise click.UsageError("a camera is missing: --focal-px, or --rig for a stereo pair")
    facts, note = dilution(read_tags_json(tags_path), **options)
    if note:
        click.echo(f"note: {note}", err=True)
    if as_json:
        show_json(facts)
    else:
        tried = facts.pop("monte_carlo", {})
        show_facts(facts | {f"tried {name}": value for name, value in tried.items()})
