"""Where everything that happens waits for the one loop that owns the state."""

import threading
from collections import deque
from typing import Any

from tagmap.mapping.draft import Arrival

CAPACITY = 2048


class Inbox:
    """Arrivals are bounded: a full inbox makes their sender's thread wait, as a slow disk would.

    Other events (queries, solutions, changes of presence) are few and never wait behind arrivals.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._arrivals: deque[Arrival] = deque()
        self._events: deque[Any] = deque()
        self._changed = threading.Condition()
        self._closed = False

    def put_arrival(self, arrival: Arrival) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._closed or len(self._arrivals) < self._capacity)
            if not self._closed:
                self._arrivals.append(arrival)
                self._changed.notify_all()

    def put(self, event: Any) -> None:
        with self._changed:
            self._events.append(event)
            self._changed.notify_all()

    def take(self, at_most: int, timeout_s: float) -> tuple[list[Any], list[Arrival]]:
        """All events and the oldest arrivals; waits while there are none of both."""
        with self._changed:
            self._changed.wait_for(lambda: self._arrivals or self._events, timeout_s)
            events = list(self._events)
            self._events.clear()
            count = min(at_most, len(self._arrivals))
            arrivals = [self._arrivals.popleft() for _ in range(count)]
            self._changed.notify_all()
        return events, arrivals

    def close(self) -> None:
        """Let go of everybody who waits; what still arrives is dropped, to be sent again."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
