"""What the commands that emulate devices share: where they listen, among what, for how long."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from fleet.simulation.scene.description import SceneDescription
    from fleet.simulation.scene.keeping import KeptMemories

READER = "emulated"
LOOK_S = 0.1

for_a_time = click.option(
    "--duration-s", type=click.FloatRange(min=0.0), metavar="S", help="End after S seconds."
)


def in_scene(about: str) -> Callable[[Any], Any]:
    """The option --scene."""
    kind = click.Path(path_type=Path, dir_okay=False)
    return click.option("--scene", metavar="FILE", type=kind, help=about)


def stay(duration_s: float | None, kept: "KeptMemories | None") -> None:
    """Until the time is over or somebody interrupts."""
    import time

    end_s = time.monotonic() + duration_s if duration_s is not None else float("inf")
    while time.monotonic() < end_s:
        time.sleep(min(LOOK_S, max(0.0, end_s - time.monotonic())))
        if kept is not None:
            kept.keep()


def address(listen: str) -> tuple[str, int]:
    found = re.fullmatch(r"(.+):(\d{1,5})", listen)
    if found is None:
        raise click.BadParameter(f"{listen!r} is not HOST:PORT", param_hint="--listen")
    return found[1], int(found[2])


def described(scene: Path | None, tags: tuple[str, ...]) -> "SceneDescription":
    import msgspec

    from fleet.simulation.scene.description import (
        SceneDescription,
        TagDescription,
        read_description,
    )

    more = [{"epc": epc.lower(), "lit": "always"} for epc in tags]
    try:
        described = msgspec.convert(more, tuple[TagDescription, ...])
    except msgspec.ValidationError as error:
        raise click.BadParameter(str(error), param_hint="--tag") from None
    base = read_description(scene) if scene else SceneDescription()
    return msgspec.structs.replace(base, tag=base.tag + described)
