"""`fleet emulate galvo`"""

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fleet.cli.emulating import READER, address, described, for_a_time, in_scene, stay

if TYPE_CHECKING:
    from fleet.simulation.scene.description import SceneDescription
    from fleet.simulation.scene.laser import TrueLaser


@click.command()
@click.option(
    "--scanner",
    required=True,
    metavar="SCANNER.toml",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The scanner as it truly is.",
)
@click.option(
    "--listen",
    default="127.0.0.1:5085",
    show_default=True,
    metavar="HOST:PORT",
    help="Where datagrams come; port 0 is any free one.",
)
@in_scene("Tags, reader, and where cam is, as TOML.")
@click.option(
    "--llrp",
    metavar="HOST:PORT",
    help="Also emulate the reader of the same scene there.",
)
@click.option(
    "--lose-every", type=click.IntRange(min=0), default=0, metavar="N", help="Lose each N-th."
)
@for_a_time
def galvo(
    scanner: Path,
    listen: str,
    scene: Path | None,
    llrp: str | None,
    lose_every: int,
    duration_s: float | None,
) -> None:
    """A laser with two mirrors, until Ctrl-C. Tags answer while its beam is on them."""
    import time

    from fleet.cli.interrupt import interruptible
    from fleet.emulation.galvo.galvo import EmulatedGalvo
    from fleet.emulation.galvo.server import GalvoServer
    from fleet.emulation.llrp.reader import EmulatedReader
    from fleet.emulation.llrp.server import LlrpServer
    from fleet.simulation.scene.description import build

    host, port = address(listen)
    description = described(scene, ())
    air = build(description, READER, time.time_ns())
    laser = _true_laser(description, scanner)
    galvo = EmulatedGalvo(air, laser, time.time_ns())
    with contextlib.ExitStack() as servers:
        servers.enter_context(interruptible())
        serving = servers.enter_context(GalvoServer(galvo, host, port, lose_every))
        click.echo(f"laser on {len(air.tags)} tags at {_shown(serving.address)}")
        if llrp:
            reader = EmulatedReader(air.antenna(READER))
            reading = servers.enter_context(LlrpServer(reader, *address(llrp)))
            click.echo(f"llrp reader with {len(air.tags)} tags at {_shown(reading.address)}")
        stay(duration_s, None)


def _shown(address: tuple[str, int]) -> str:
    return f"{address[0]}:{address[1]}"


def _true_laser(description: "SceneDescription", scanner: Path) -> "TrueLaser":
    import numpy as np

    from fleet.simulation.scene.laser import TrueLaser
    from tagmap.geometry import se3
    from tagmap.records import arrays
    from tagmap.records.scanner_file import read_scanner

    calibration = read_scanner(scanner)
    laser = description.laser
    T_map_cam = se3.from_p_q(np.array(laser.p_m), np.array(laser.q_wxyz))
    return TrueLaser(
        READER,
        arrays.scanner(calibration),
        arrays.drive(calibration.drive),
        lambda: T_map_cam,
        laser.reach_m,
        laser.range_m,
    )
