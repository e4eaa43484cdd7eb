"""`robot-agent calibrate scanner`"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tagmap.cli.options import Number
from tagmap.errors import TagmapError

if TYPE_CHECKING:
    from robot_agent.calibration.scanner.calibration import AimCalibration


@click.command()
@click.argument("samples", metavar="SAMPLES.csv", type=click.Path(path_type=Path))
@click.option(
    "--model",
    default="full",
    show_default=True,
    type=click.Choice(["simplified", "full"]),
    help="Ideal mirrors but for their separation, or all parameters.",
)
@click.option(
    "--out",
    required=True,
    metavar="SCANNER.toml",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the calibration here.",
)
@click.option(
    "--drive",
    metavar="FILE.toml",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Take [drive] from there: limits, volts, converter.  [default: what SCANNER.toml has]",
)
@click.option(
    "--sigma-theta-rad",
    default=3e-4,
    show_default=True,
    metavar="S",
    type=Number(min=1e-7, max=0.1),
    help="Deviation of one mirror angle.",
)
@click.option(
    "--sigma-point-m",
    default=2e-3,
    show_default=True,
    metavar="S",
    type=Number(min=1e-6, max=1.0),
    help="Deviation of one coordinate of a target.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def scanner(
    samples: Path,
    model: str,
    out: Path,
    drive: Path | None,
    sigma_theta_rad: float,
    sigma_point_m: float,
    as_json: bool,
) -> None:
    """Calibrate the laser scanner from beams that met targets.

    SAMPLES.csv has the header theta1_rad,theta2_rad,x_m,y_m,z_m: angles of mirrors X and Y, and the
    target in cam. Bad samples are found, named and left out.
    """
    from datetime import UTC, datetime

    import tagmap
    from robot_agent.calibration.folder import require_place
    from robot_agent.calibration.scanner.calibration import calibrate_file
    from robot_agent.calibration.scanner.fit import Noise
    from robot_agent.calibration.scanner.report import as_record, as_remarks
    from tagmap.records.scanner import DriveLimits
    from tagmap.records.scanner_file import read_drive, write_scanner

    try:
        require_place(out)
        # Limits keep mirrors and people safe: they are not reset by the way.
        kept = drive or (out if out.exists() else None)
        limits = read_drive(kept) if kept else DriveLimits()
        found = calibrate_file(model, samples, Noise(sigma_theta_rad, sigma_point_m))
        made = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        record = as_record(found, limits, made, by=f"robot-agent {tagmap.__version__}")
        write_scanner(out, record, as_remarks(found))
    except TagmapError as error:
        click.echo(f"robot-agent: {error}", err=True)
        sys.exit(1)
    _show(found, str(out), as_json)


def _show(found: "AimCalibration", out: str, as_json: bool) -> None:
    from robot_agent.calibration.scanner.report import as_contract, told
    from tagmap.cli.show import show_facts, show_json, show_table

    contract = {"scanner": out} | as_contract(found)
    if as_json:
        show_json(contract)
        return
    rows = [
        [
            name,
            f"{value:.5g}",
            f"{contract['sigmas'][name]:.2g}" if name in found.scanner.free else "fixed",
        ]
        for name, value in contract["mirrors"].items()
    ]
    show_table("mirrors", ["parameter", "value", "sigma"], rows)
    if found.bad:
        show_table("left out", ["line", "reason"], [list(row) for row in found.bad])
    show_facts(
        {
            "samples": f"{contract['samples']} good, rms {1e3 * found.rms_m:.2f} mm",
            "held out near": told(found.near),
            "held out far": told(found.far),
            "scanner": out,
        }
    )
    for note in found.notes:
        click.echo(f"note: {note}", err=True)
