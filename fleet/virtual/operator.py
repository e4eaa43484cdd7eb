"""Who looks at the site and steers it in virtual time, as the command line does."""

from typing import Any

from fleet.virtual.bus import Bus
from tagmap.errors import LinkError, TagmapError
from tagmap.link.keys import Keys
from tagmap.records import AdminReply, AdminRequest, decode, encode

REPLY_BYTES = 2**26
PATIENCE_S = 600.0


class Operator:
    """Each call waits, in the life that makes it."""

    def __init__(self, bus: Bus, keys: Keys, name: str = "operator") -> None:
        self._port, self._keys = bus.port(name), keys

    def ask(self, noun: str, verb: str, **args: Any) -> Any:
        """Raises LinkError when nobody answers, TagmapError when the service refuses."""
        payload = encode(AdminRequest(args=args))
        selector = self._keys.admin(noun, verb)
        for reply in self._port.ask(selector, payload, timeout_s=PATIENCE_S):
            if reply.payload is None:
                raise LinkError(f"{selector}: {reply.error}")
            answer = decode(AdminReply, reply.payload, REPLY_BYTES)
            if answer.error is not None:
                raise TagmapError(f"{noun} {verb}: {answer.error}")
            return answer.data
        raise LinkError(f"{selector}: nobody could be asked")

    def solve_finally(self) -> Any:
        """The map over everything that was sent, from nothing: what the version is made of."""
        return self.ask("map", "solve", from_nothing=True)
