"""`robot-agent calibrate`"""

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robot_agent.cli.calibrate_scanner import scanner
from tagmap.cli.options import Number
from tagmap.errors import TagmapError

if TYPE_CHECKING:
    from robot_agent.calibration.stereo import StereoCalibration


class BoardSize(click.ParamType[tuple[int, int]]):
    """COLSxROWS, inner corners."""

    name = "COLSxROWS"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d{1,3})x(\d{1,3})", str(value))
        if match is None or min(map(int, match.groups())) < 3:
            self.fail(f"{value!r}: expected inner corners as 9x6, at least 3x3", param, ctx)
        return int(match[1]), int(match[2])


@click.group()
def calibrate() -> None:
    """Find out what the robot must know of its own sensors."""


calibrate.add_command(scanner)


@calibrate.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--board", "size", required=True, type=BoardSize(), help="Inner corners of the chessboard."
)
@click.option(
    "--square-m",
    required=True,
    metavar="S",
    type=Number(min=1e-4, max=10.0),
    help="Side of one square in m, as measured.",
)
@click.option(
    "--out",
    required=True,
    metavar="RIG.toml",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the rig here, and a picture beside it.",
)
@click.option(
    "--window-px",
    metavar="N",
    type=click.IntRange(2, 50),
    help="Half the window that refines a corner.  [default: a third of the smallest square]",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def stereo(
    folder: Path,
    size: tuple[int, int],
    square_m: float,
    out: Path,
    window_px: int | None,
    as_json: bool,
) -> None:
    """Calibrate a stereo rig from pairs of images of a chessboard.

    FOLDER holds left* and right* as PNG, JPEG or TIFF; left01.png and right01.png are a pair, taken
    at the same time. Bad pairs are found, named and left out.
    """
    from datetime import UTC, datetime

    import tagmap
    from robot_agent.calibration.board import Board
    from robot_agent.calibration.folder import calibrate_folder, picture_of, require_place, save

    tell = _tell if sys.stderr.isatty() else _keep_quiet
    try:
        require_place(out)
        calibration = calibrate_folder(folder, Board(*size, square_m), window_px, tell)
        made = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        save(calibration, out, made, by=f"robot-agent {tagmap.__version__}")
    except TagmapError as error:
        click.echo(f"robot-agent: {error}", err=True)
        sys.exit(1)
    _show(calibration, {"rig": str(out), "picture": str(picture_of(out))}, as_json)


def _show(calibration: "StereoCalibration", files: dict[str, str], as_json: bool) -> None:
    from robot_agent.calibration.report import as_contract
    from tagmap.cli.show import show_facts, show_json, show_table

    contract = files | as_contract(calibration)
    if as_json:
        show_json(contract)
        return
    used = [
        [name, f"{left:.3f}", f"{right:.3f}", window, f"{customary:.3f}", ""]
        for name, (left, right, window, customary) in (
            (name, pair.values()) for name, pair in contract["pairs"].items()
        )
    ]
    left_out = [[name, *4 * [None], reason] for name, reason in contract["rejected"].items()]
    columns = ["pair", "left px", "right px", "window px", "with 11 px", "left out"]
    show_table("pairs", columns, sorted(used + left_out, key=lambda row: str(row[0])))
    sigmas = contract["sigmas"]
    facts = {
        "baseline": f"{1e3 * contract['baseline_m']:.2f} +- {1e3 * sigmas['baseline_m']:.2g} mm",
        "rms": f"{contract['rms_px']:.3f} px, sigma {contract['sigma_px']:.3f} px per coordinate",
    }
    rig = calibration.fit.rig
    for side, camera in (("left", rig.left), ("right", rig.right)):
        of_camera = contract["cameras"][side]["sigmas"]
        facts[f"{side} fx, fy"] = ", ".join(
            f"{value:.2f} +- {of_camera[name]:.2g} px"
            for name, value in (("fx_px", camera.fx_px), ("fy_px", camera.fy_px))
        )
    show_facts(facts | files)
    for note in contract["notes"]:
        click.echo(f"note: {note}", err=True)


def _tell(line: str) -> None:
    click.echo(line, err=True)


def _keep_quiet(line: str) -> None:
    """A log file needs no progress."""
