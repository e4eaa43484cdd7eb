"""Who looks at the site and steers it in virtual time, as the command line does."""

from typing import Any

from fleet.virtual.bus import Bus
from tagmap.errors import LinkError, RecordRefused, TagmapError
from tagmap.link.keys import Keys
from tagmap.link.query import Reply
from tagmap.records import AdminReply, AdminRequest, decode, encode

REPLY_BYTES = 2**26
PAUSE_NS = 250_000_000
TRIES, TRY_S = 20, 30.0


class Operator:
    """Each call waits, in the life that makes it."""

    def __init__(self, bus: Bus, keys: Keys, name: str = "operator") -> None:
        self._port, self._keys = bus.port(name), keys

    def ask(self, noun: str, verb: str, **args: Any) -> Any:
        """Again while question or answer may have been lost. Raises LinkError when nobody answers,
        TagmapError when the service refuses."""
        payload = encode(AdminRequest(args=args))
        selector = self._keys.admin(noun, verb)
        for _ in range(TRIES):
            for reply in self._port.get(selector, payload, timeout_s=TRY_S):
                if (answer := _answer(reply)) is not None:
                    if answer.error is not None:
                        raise TagmapError(f"{noun} {verb}: {answer.error}")
                    return answer.data
            self._port.wait(lambda: False, self._port.now_ns() + PAUSE_NS)
        raise LinkError(f"{selector}: no answer, asked {TRIES} times")

    def solve_finally(self) -> Any:
        """The map over everything that was sent, from nothing: what the version is made of."""
        return self.ask("map", "solve", from_nothing=True)


def _answer(reply: Reply) -> AdminReply | None:
    """None where it did not come, or not whole."""
    if reply.payload is None:
        return None if reply.error == "Timeout" else AdminReply(error=reply.error)
    try:
        return decode(AdminReply, reply.payload, REPLY_BYTES)
    except RecordRefused:
        return None
