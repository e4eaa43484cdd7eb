"""Where everything that happens waits for the one loop that owns the state."""

import threading
import time
from collections import deque
from typing import Any

from tagmap.mapping.draft import Arrival

CAPACITY = 2048
GATHER_S = 0.02


class Inbox:
    """Arrivals are bounded: a full inbox makes their sender's thread wait, as a slow disk would.

    Other events (queries, solutions, changes of presence) are few and never wait behind arrivals.

    Arrivals are given out at most every `gather_s`: under load many are then committed together,
    which costs little more than one; without, none waits, as the last time is long ago.
    """

    def __init__(self, capacity: int, gather_s: float = 0.0) -> None:
        self._capacity, self._gather_s = capacity, gather_s
        self._arrivals: deque[Arrival] = deque()
        self._events: deque[Any] = deque()
        lock = threading.Lock()
        self._something, self._urgent = threading.Condition(lock), threading.Condition(lock)
        self._room = threading.Condition(lock)
        self._closed = False
        self._ready_s = 0.0

    def put_arrival(self, arrival: Arrival) -> None:
        with self._room:
            self._room.wait_for(lambda: self._closed or len(self._arrivals) < self._capacity)
            if not self._closed:
                self._arrivals.append(arrival)
                self._something.notify()
                if self._is_filling:
                    self._urgent.notify()

    def put(self, event: Any) -> None:
        with self._something:
            self._events.append(event)
            self._something.notify()
            self._urgent.notify()

    def take(self, at_most: int, timeout_s: float) -> tuple[list[Any], list[Arrival]]:
        """All events and the oldest arrivals; waits while there are none of both."""
        with self._something:
            self._something.wait_for(lambda: self._arrivals or self._events, timeout_s)
            left_s = min(timeout_s, self._ready_s - time.monotonic())
            if left_s > 0.0 and self._arrivals:
                self._urgent.wait_for(lambda: self._events or self._is_filling, left_s)
            events = list(self._events)
            self._events.clear()
            arrivals = self._ready(at_most)
            self._room.notify_all()
        return events, arrivals

    def close(self) -> None:
        """Let go of everybody who waits; what still arrives is dropped, to be sent again."""
        with self._something:
            self._closed = True
            for waiting in (self._something, self._urgent, self._room):
                waiting.notify_all()

    @property
    def _is_filling(self) -> bool:
        return 4 * len(self._arrivals) >= self._capacity

    def _ready(self, at_most: int) -> list[Arrival]:
        """None while more are gathered."""
        now_s = time.monotonic()
        if now_s < self._ready_s and not self._is_filling:
            return []
        count = min(at_most, len(self._arrivals))
        if count:
            self._ready_s = now_s + self._gather_s
        return [self._arrivals.popleft() for _ in range(count)]
