"""`tagmap localize`."""

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tagmap.cli.ask import MAX_REPLY_BYTES, TIMEOUT_S, get
from tagmap.cli.options import Number, Target, client
from tagmap.cli.pose_facts import for_people
from tagmap.cli.show import show_facts, show_json
from tagmap.errors import ConfigError

if TYPE_CHECKING:
    from tagmap.records.rig import RigCalibration

STDIN = "-"

_PROBABILITY = Number(min=0.0, max=1.0, max_open=True)


@click.command()
@click.argument("path", metavar="[FILE]", type=click.Path(path_type=Path), default=STDIN)
@click.option("--risk", type=_PROBABILITY, help="That the protection level is exceeded.  [1e-4]")
@click.option(
    "--p-false-alarm",
    type=_PROBABILITY,
    help="That right tags are taken for wrong, part of the risk.  [a tenth of it]",
)
@click.option("--p-wrong", type=_PROBABILITY, help="That a tag moved or is another.  [1e-3]")
@click.option("--p-swapped", type=_PROBABILITY, help="That two tags have swapped names.  [1e-3]")
@client
def localize(target: Target, path: Path, **promise: float | None) -> None:
    """Compute one pose from tags seen from one place.

    FILE (or - for stdin) is JSON of one of two forms. With tags, their positions and pixels,
    `{"rig", "tags", "left", "right", "sigma_px"}`, it is answered here, without a service. With
    measurements of tags that are on the service's map it is a LocalizeRequest, `{"kind",
    "T_base_cam", "rig", "measurements": [{"tag", "z"}]}`, and the service answers.
    """
    from tagmap.records.json_file import LARGEST_BYTES, parse_json, read_json

    if str(path) == STDIN:
        path = Path("stdin")
        tree = parse_json(sys.stdin.buffer.read(LARGEST_BYTES + 1), str(path))
    else:
        tree = read_json(path)
    stated = {name: value for name, value in promise.items() if value is not None}
    brings_its_map = _brings_its_map(tree)
    if brings_its_map:
        reply = _answer_here(tree, path, stated)
    elif stated:
        raise click.UsageError(f"FILE asks the service, which takes no {', '.join(stated)}")
    else:
        reply = _ask(target, tree, str(path))
    if target.as_json:
        show_json(reply)
    else:
        show_facts(for_people(reply) if brings_its_map else reply)


def _brings_its_map(tree: Any) -> bool:
    if not isinstance(tree, dict):
        return True
    return "measurements" not in tree and ("tags" in tree or "left" in tree)


def _answer_here(tree: Any, path: Path, stated: Mapping[str, float]) -> dict[str, Any]:
    from tagmap.localisation.answer import answer
    from tagmap.localisation.integrity.promise import Promise
    from tagmap.records.arrays import stereo_rig
    from tagmap.records.view_file import check_inside, view_of

    file = view_of(tree, str(path))
    rig = file.rig if not isinstance(file.rig, str) else _find_rig(file.rig, path)
    check_inside(file, rig, str(path))
    return answer(file, stereo_rig(rig), Promise.at(**stated))


def _find_rig(name: str, path: Path) -> "RigCalibration":
    """A rig file, also beside `path`, or a preset."""
    from tagmap.records.rig_file import find_rig

    beside = str(path.parent / name)
    try:
        return find_rig(beside if os.path.isfile(beside) else name)
    except ConfigError as error:
        raise ConfigError(f"{path}: rig: {error}") from None


def _ask(target: Target, tree: Any, name: str) -> Any:
    import msgspec

    from tagmap.link.keys import Keys
    from tagmap.records import LocalizeReply, LocalizeRequest, decode, encode
    from tagmap.records.json_file import as_record

    message = as_record(tree, LocalizeRequest, name)
    payload = get(target, Keys(target.site).localize(), encode(message), TIMEOUT_S)
    return msgspec.to_builtins(decode(LocalizeReply, payload, MAX_REPLY_BYTES))
