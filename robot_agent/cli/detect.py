"""`robot-agent detect`"""

import sys
from pathlib import Path
from typing import Any

import click

from tagmap.cli.options import Number
from tagmap.errors import TagmapError


@click.command()
@click.argument("left", type=click.Path(path_type=Path))
@click.argument("right", type=click.Path(path_type=Path))
@click.option(
    "--rig",
    required=True,
    metavar="RIG.toml",
    help="Stereo calibration, or a preset: thesis, wide-angle.",
)
@click.option(
    "--gain",
    default=0.0,
    metavar="G",
    type=Number(min=0.0),
    help="Grey levels per electron, for shot noise.  [default: 0, as if there were none]",
)
@click.option(
    "--full-scale",
    metavar="LEVEL",
    type=click.IntRange(1, 65535),
    help="Grey level at which the sensor saturates.  [default: largest of the image's type]",
)
@click.option(
    "--picture",
    metavar="OUT.png",
    type=click.Path(path_type=Path),
    help="Draw both images with what was found in them.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def detect(
    left: Path,
    right: Path,
    rig: str,
    gain: float,
    full_scale: int | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Find tags in a pair of images: spots, matches, and positions in the left camera's frame.

    LEFT and RIGHT are grey PNG or TIFF files of 8 or 16 bits.
    """
    from robot_agent.perception.detection import detect_files
    from robot_agent.perception.spots import Optics

    if picture is not None:
        _check_picture(picture, (left, right))
    try:
        found = detect_files(left, right, rig, Optics(gain=gain, full_scale=full_scale))
        if picture is not None:
            found.draw(picture)
    except TagmapError as error:
        click.echo(f"robot-agent: {error}", err=True)
        sys.exit(1)
    for line in found.over_exposed:
        click.echo(line, err=True)
    if as_json:
        import json

        click.echo(json.dumps(found.as_contract(), allow_nan=False))
    else:
        _show(found.as_contract())


def _check_picture(picture: Path, images: tuple[Path, Path]) -> None:
    """What was measured is not drawn over."""
    if picture.suffix.lower() != ".png":
        raise click.UsageError(f"--picture {picture}: expected a name that ends in .png")
    if picture.exists() and any(image.exists() and picture.samefile(image) for image in images):
        raise click.UsageError(f"--picture {picture} is one of the images")


def _show(contract: dict[str, Any]) -> None:
    from tagmap.cli.show import show_table

    for side in ("left", "right"):
        rows = [
            [k, f"{s['u_px']:.3f}", f"{s['v_px']:.3f}", _sigma(s["cov_px2"]), f"{s['flux']:.0f}",
             ", ".join(s["flags"])]
            for k, s in enumerate(contract[side])
        ]  # fmt: skip
        show_table(side, ["#", "u px", "v px", "sigma px", "flux", "flags"], rows)
    rows = [
        [f"{m['left']} - {m['right']}", *(f"{x:.3f}" for x in m["p_cam_m"]),
         f"{max(0.0, m['cov_m2'][5]) ** 0.5:.3f}", "yes" if m["ambiguous"] else ""]
        for m in contract["matches"]
    ]  # fmt: skip
    show_table("matches", ["spots", "x m", "y m", "z m", "sigma z m", "ambiguous"], rows)


def _sigma(cov: list[float] | None) -> str:
    return "" if cov is None else f"{((cov[0] + cov[2]) / 2.0) ** 0.5:.3f}"
