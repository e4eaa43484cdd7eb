"""`tagmap localize`."""

from pathlib import Path
from typing import IO, Any

import click

from tagmap.cli.ask import MAX_REPLY_BYTES, TIMEOUT_S, Refused, get
from tagmap.cli.options import Target, client
from tagmap.cli.show import show_facts, show_json


@click.command()
@click.argument("request", metavar="[FILE]", type=click.File("rb"), default="-")
@client
def localize(target: Target, request: IO[bytes]) -> None:
    """Compute one pose from tags seen from one place.

    FILE (or - for stdin) is JSON of one of two forms. With tags, their positions and pixels,
    `{"rig", "tags", "left", "right", "sigma_px"}`, it is answered here, without a service. With
    measurements of tags that are on the service's map it is a LocalizeRequest, `{"kind",
    "T_base_cam", "rig", "measurements": [{"tag", "z"}]}`, and the service answers.
    """
    content = request.read()
    if _brings_its_map(content):
        reply = _answer_here(content, request.name)
    else:
        reply = _ask_the_service(target, content, request.name)
    if target.as_json:
        show_json(reply)
    else:
        show_facts(reply)


def _brings_its_map(content: bytes) -> bool:
    """A request to the service is also what cannot be read: its errors are the clearer ones."""
    import msgspec

    try:
        keys = msgspec.json.decode(content, type=dict[str, msgspec.Raw])
    except (msgspec.DecodeError, UnicodeDecodeError):
        return False
    return "measurements" not in keys and ("tags" in keys or "left" in keys)


def _answer_here(content: bytes, name: str) -> dict[str, Any]:
    import msgspec

    from tagmap.localisation.answer import answer
    from tagmap.records.arrays import stereo_rig
    from tagmap.records.rig_file import find_rig
    from tagmap.records.view_file import ViewFile

    try:
        file = msgspec.json.decode(content, type=ViewFile)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise Refused(f"{name}: {error}") from None
    rig = file.rig
    if isinstance(rig, str):
        beside = Path(name).parent / rig
        rig = find_rig(str(beside) if beside.is_file() else rig)
    return answer(file, stereo_rig(rig))


def _ask_the_service(target: Target, content: bytes, name: str) -> Any:
    import msgspec

    from tagmap.link.keys import Keys
    from tagmap.records import LocalizeReply, LocalizeRequest, decode, encode

    try:
        message = msgspec.json.decode(content, type=LocalizeRequest)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise Refused(f"{name}: {error}") from None
    payload = get(target, Keys(target.site).localize(), encode(message), TIMEOUT_S)
    return msgspec.to_builtins(decode(LocalizeReply, payload, MAX_REPLY_BYTES))
