"""Where what arrived waits for the service, in virtual time."""

from collections import deque
from typing import Any

from fleet.virtual.port import Port
from tagmap.mapping.draft import Arrival
from tagmap.service.inbox import CAPACITY
from tagmap.service.listening import RING


class VirtualInbox:
    """As tagmap.service.inbox.Inbox behind a ring: beyond both, the ring's oldest are dropped."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self._arrivals: deque[Arrival] = deque()
        self._events: deque[Any] = deque()
        self.dropped = 0

    def put_arrival(self, arrival: Arrival) -> None:
        if len(self._arrivals) >= CAPACITY + RING:
            del self._arrivals[CAPACITY]
            self.dropped += 1
        self._arrivals.append(arrival)

    def put(self, event: Any) -> None:
        self._events.append(event)

    def take(self, at_most: int, timeout_s: float) -> tuple[list[Any], list[Arrival]]:
        until_ns = self._port.now_ns() + round(timeout_s * 1e9)
        self._port.wait(lambda: bool(self._arrivals or self._events), until_ns)
        events = list(self._events)
        self._events.clear()
        count = min(at_most, len(self._arrivals))
        return events, [self._arrivals.popleft() for _ in range(count)]
