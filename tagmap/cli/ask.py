"""Ask the running service."""

import time
from typing import TYPE_CHECKING, Any

from tagmap.cli.options import Target
from tagmap.errors import LinkError, TagmapError

if TYPE_CHECKING:
    from tagmap.link.session import Link

WAIT_S = 3.0
PAUSE_S = 0.1
TIMEOUT_S = 10.0
MAX_REPLY_BYTES = 2**30


class Refused(TagmapError):
    """The service answered, with a reason why not."""


def ask(target: Target, noun: str, verb: str, timeout_s: float = TIMEOUT_S, **args: Any) -> Any:
    """The data of one `admin/<noun>/<verb>` answer."""
    from tagmap.link.keys import Keys
    from tagmap.records import AdminReply, AdminRequest, decode, encode

    with_values = {name: value for name, value in args.items() if value is not None}
    key = Keys(target.site).admin(noun, verb)
    payload = get(target, key, encode(AdminRequest(args=with_values)), timeout_s)
    reply = decode(AdminReply, payload, MAX_REPLY_BYTES)
    if reply.error is not None:
        raise Refused(reply.error)
    return reply.data


def get(target: Target, selector: str, payload: bytes | None, timeout_s: float) -> bytes:
    """The first answer. None at all can mean that the link is still settling: try again."""
    from tagmap.link.session import Link

    link = Link.open(
        list(target.connect),
        zenoh_config=target.zenoh_config,
        wait_s=WAIT_S,
        stopped=lambda: False,
    )
    try:
        return _get(link, target, selector, payload, timeout_s)
    finally:
        link.close()


def _get(
    link: "Link", target: Target, selector: str, payload: bytes | None, timeout_s: float
) -> bytes:
    give_up_s = time.monotonic() + WAIT_S
    while True:
        for reply in link.get(selector, payload, timeout_s=timeout_s):
            if reply.error == "Timeout":
                raise LinkError(f"no answer from the map service within {timeout_s:g} s")
            if reply.error is not None:
                raise Refused(reply.error)
            if reply.payload is not None:
                return reply.payload
        if time.monotonic() > give_up_s:
            where = ", ".join(target.connect) or str(target.zenoh_config)
            raise LinkError(f"no map service of site {target.site!r} answers at {where}")
        time.sleep(PAUSE_S)
