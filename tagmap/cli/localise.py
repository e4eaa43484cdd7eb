"""`tagmap localize`."""

from typing import IO

import click

from tagmap.cli.ask import MAX_REPLY_BYTES, TIMEOUT_S, Refused, get
from tagmap.cli.options import Target, client
from tagmap.cli.show import show_facts, show_json


@click.command()
@click.argument("request", type=click.File("rb"), default="-")
@client
def localize(target: Target, request: IO[bytes]) -> None:
    """Compute one pose from tags seen from one place.

    REQUEST is a file (or - for stdin) with the JSON form of a LocalizeRequest: `{"kind",
    "T_base_cam", "rig", "measurements": [{"tag", "z"}]}`; see `tagmap schema`.
    """
    import msgspec

    from tagmap.link.keys import Keys
    from tagmap.records import LocalizeReply, LocalizeRequest, decode, encode

    try:
        message = msgspec.json.decode(request.read(), type=LocalizeRequest)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise Refused(f"{request.name}: {error}") from None
    payload = get(target, Keys(target.site).localize(), encode(message), TIMEOUT_S)
    reply = msgspec.to_builtins(decode(LocalizeReply, payload, MAX_REPLY_BYTES))
    if target.as_json:
        show_json(reply)
    else:
        show_facts(reply)
