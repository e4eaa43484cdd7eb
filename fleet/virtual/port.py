"""A participant's end of the bus: what a process has of Zenoh, in virtual time.

Nothing runs by itself: what has arrived is handled when its owner waits, in the owner's life, as
if by threads that only enqueue. Several lives may wait at one port, as threads of one process.
"""

import heapq
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, TypeAlias

from fleet.virtual.matching import meets
from fleet.virtual.virtual_time import Bell
from tagmap.errors import LinkError
from tagmap.link.query import Query, Reply

if TYPE_CHECKING:
    from fleet.virtual.bus import Bus

RETRY_S = 0.25

Moment: TypeAlias = Literal["waiting", "sending", "sent"]
"""When a process dies: while it waits, or when it next sends something, before or after it."""


class Killed(BaseException):
    """kill -9: whoever uses the port of a process that is dead."""


class Port:
    """Make one with `Bus.port`. Has the methods of tagmap.link.session.Link that are used."""

    def __init__(self, bus: "Bus", name: str) -> None:
        self.bus, self.name = bus, name
        self.subscribed: list[tuple[str, Callable[[str, bytes], None]]] = []
        self.served: list[tuple[str, Callable[[Query], None]]] = []
        self.tokens: list[str] = []
        self.is_open = True
        self._watched: list[tuple[str, Callable[[str, bool], None], set[str]]] = []
        self._due: list[tuple[int, int, Callable[[], None]]] = []
        self._entries = 0
        self._bells: list[Bell] = []
        self._death: tuple[int, Moment] | None = None
        self._is_dead = False
        self._at_death: list[Callable[[], None]] = []

    # What a link does

    def put(self, key: str, payload: bytes) -> None:
        """Send and forget."""
        self._die_if_due("sending")
        self.bus.carry(self, key, payload)
        self._die_if_due("sent")

    def subscribe(
        self,
        key_expr: str,
        on_sample: Callable[[str, bytes], None],
        capacity: int = 1024,  # noqa: ARG002
    ) -> None:
        """Handlers only enqueue, so there is never anything for a ring to drop."""
        self.subscribed.append((key_expr, on_sample))

    def serve(self, key_expr: str, on_query: Callable[[Query], None]) -> None:
        self.served.append((key_expr, on_query))

    def inquire(
        self,
        selector: str,
        payload: bytes | None,
        timeout_s: float,
        on_end: Callable[[list[Reply]], None],
    ) -> None:
        """`get` without waiting: `on_end` is called once, with all answers."""
        self._die_if_due("sending")
        self.bus.inquire(self, selector, payload or b"", self._ns(timeout_s), on_end)
        self._die_if_due("sent")

    def get(
        self, selector: str, payload: bytes | None = None, *, timeout_s: float = 5.0
    ) -> list[Reply]:
        found: list[list[Reply]] = []
        self.inquire(selector, payload, timeout_s, found.append)
        self.wait(lambda: bool(found), self.now_ns() + self._ns(timeout_s) + 1)
        return found[0]

    def ask(
        self, selector: str, payload: bytes | None = None, *, timeout_s: float = 5.0
    ) -> list[Reply]:
        """`get`, repeated until somebody answers. LinkError when nobody does in `timeout_s`."""
        until_ns = self.now_ns() + self._ns(timeout_s)
        while (left_ns := until_ns - self.now_ns()) > 0:
            replies = self.get(selector, payload, timeout_s=left_ns / 1e9)
            if any(reply.error != "Timeout" for reply in replies):
                return replies
            self.wait(lambda: False, min(until_ns, self.now_ns() + self._ns(RETRY_S)))
        raise LinkError(f"no answer to {selector} within {timeout_s:g} s")

    def declare_alive(self, key: str) -> None:
        self.tokens.append(key)

    def watch_alive(self, key_expr: str, on_change: Callable[[str, bool], None]) -> None:
        self._watched.append((key_expr, on_change, set()))

    def connected(self) -> bool:
        return self.is_open and not self.bus.connection(self.name).is_noticed(self.now_ns())

    def close(self) -> None:
        """Nothing arrives any more. May be repeated."""
        self.is_open = False
        self.subscribed, self.served, self.tokens = [], [], []
        self._watched, self._due = [], []

    # Its time

    def now_ns(self) -> int:
        return self.bus.time.now_ns()

    def at(self, t_ns: int, act: Callable[[], None]) -> None:
        """Done by whoever waits at this port then."""
        if not self.is_open:
            return
        heapq.heappush(self._due, (t_ns, self._entries, act))
        self._entries += 1
        for bell in self._bells:
            bell.ring(t_ns)

    def wait(self, over: Callable[[], bool], until_ns: int) -> None:
        """Handle what arrives until `over()`, at most until then."""
        self._handle()
        while not over() and self.now_ns() < until_ns:
            bell = Bell()
            self._bells.append(bell)
            try:
                self.bus.time.wait_until(min(until_ns, self._next_ns()), bell)
            finally:
                self._bells.remove(bell)
            self._handle()

    # Its end

    def kill_at(self, t_ns: int, moment: Moment = "waiting") -> None:
        self._death = (t_ns, moment)
        for bell in self._bells:
            bell.ring(t_ns)

    def at_death(self, act: Callable[[], None]) -> None:
        """At the very moment, before anything of the process is tidied up."""
        self._at_death.append(act)

    def _die_if_due(self, moment: Moment) -> None:
        death = self._death
        is_due = death is not None and death[1] == moment and self.now_ns() >= death[0]
        if is_due and not self._is_dead:
            self._is_dead = True
            for act in self._at_death:
                act()
            self.close()
        if self._is_dead:
            raise Killed(self.name)

    def _next_ns(self) -> int:
        times_ns = [self._due[0][0]] if self._due else []
        if self._death is not None and self._death[1] == "waiting":
            times_ns.append(self._death[0])
        return min(times_ns, default=2**63)

    def _handle(self) -> None:
        """What is due."""
        self._die_if_due("waiting")
        self._look_who_is_alive()
        while self._due and self._due[0][0] <= self.now_ns():
            heapq.heappop(self._due)[2]()

    def _look_who_is_alive(self) -> None:
        if not self._watched or not self.connected():
            return
        tokens = self.bus.tokens()
        for key_expr, on_change, held in self._watched:
            there = {key for key in tokens if meets(key_expr, key)}
            for key in sorted(there ^ held):
                on_change(key, key in there)
            held.clear()
            held |= there

    @staticmethod
    def _ns(seconds: float) -> int:
        return round(seconds * 1e9)
