"""`fleet emulate`: devices that are not there."""

from pathlib import Path

import click

from fleet.cli.emulating import READER, address, described, for_a_time, in_scene, stay

EVERY = click.IntRange(min=0)


@click.group()
def emulate() -> None:
    """Devices that are not there, speaking their real protocols over sockets and serial lines."""


@emulate.command()
@click.option(
    "--listen",
    default="127.0.0.1:5084",
    show_default=True,
    metavar="HOST:PORT",
    help="Where clients connect; port 0 is any free one.",
)
@in_scene("Tags and reader as TOML.")
@click.option(
    "--tag",
    "tags",
    multiple=True,
    metavar="EPC",
    help="One more tag, always lit, 64 words of user memory; repeatable.",
)
@click.option(
    "--memory",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where tags keep what is written, from run to run, as JSON.",
)
@click.option("--cut-every", type=EVERY, default=0, metavar="N", help="Cut each N-th message.")
@click.option("--garbage-every", type=EVERY, default=0, metavar="N", help="Spoil each N-th.")
@click.option("--mute-every", type=EVERY, default=0, metavar="N", help="Fall silent at each N-th.")
@for_a_time
def llrp(
    listen: str,
    scene: Path | None,
    tags: tuple[str, ...],
    memory: Path | None,
    cut_every: int,
    garbage_every: int,
    mute_every: int,
    duration_s: float | None,
) -> None:
    """An LLRP reader and its tags, until Ctrl-C. Prints where it listens, then what it is told.

    A tag answers only while it is lit: always, never, or by a schedule of the scene file.
    """
    import time

    from fleet.cli.interrupt import interruptible
    from fleet.emulation.llrp.line import LineFaults
    from fleet.emulation.llrp.reader import EmulatedReader
    from fleet.emulation.llrp.server import LlrpServer
    from fleet.simulation.scene.description import build
    from fleet.simulation.scene.keeping import KeptMemories

    host, port = address(listen)
    description = described(scene, tags)
    air = build(description, READER, time.time_ns())
    kept = KeptMemories(air, memory) if memory else None
    faults = LineFaults(cut_every, garbage_every, mute_every, description.seed)
    reader = EmulatedReader(air.antenna(READER))
    with (
        interruptible(),
        LlrpServer(reader, host, port, faults, lambda line: click.echo(line, err=True)) as server,
    ):
        host, port = server.address
        click.echo(f"llrp reader with {len(air.tags)} tags at {host}:{port}")
        stay(duration_s, kept)


@emulate.command("pan-tilt")
@click.option(
    "--link",
    metavar="PATH",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Make a link to the port there, so that its name stays the same.",
)
@click.option(
    "--baud",
    type=click.IntRange(300, 1_000_000),
    default=9600,
    show_default=True,
    metavar="N",
    help="Speed of the line.",
)
@click.option("--garbage-every", type=EVERY, default=0, metavar="N", help="Spoil each N-th answer.")
@click.option("--half-every", type=EVERY, default=0, metavar="N", help="Send half of each N-th.")
@click.option("--mute-every", type=EVERY, default=0, metavar="N", help="Do not send each N-th.")
@click.option(
    "--noise-every", type=EVERY, default=0, metavar="N", help="Change a byte of each N-th."
)
@for_a_time
def pan_tilt(
    link: Path | None,
    baud: int,
    garbage_every: int,
    half_every: int,
    mute_every: int,
    noise_every: int,
    duration_s: float | None,
) -> None:
    """A PTU-D46 on a pseudo terminal, until Ctrl-C. Prints the port to open."""
    from fleet.cli.interrupt import interruptible
    from fleet.emulation.pan_tilt.line import SerialFaults
    from fleet.emulation.pan_tilt.terminal import UnitTerminal
    from fleet.emulation.pan_tilt.unit import Unit

    faults = SerialFaults(garbage_every, half_every, mute_every, noise_every)
    with interruptible(), UnitTerminal(Unit(), link, faults, baud) as terminal:
        click.echo(f"pan-tilt unit at {link or terminal.path}")
        stay(duration_s, None)
