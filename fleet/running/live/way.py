"""One direction of a TCP connection through a proxy: what was read and not yet passed on."""

import socket
from collections import deque
from dataclasses import dataclass, field

CHUNK_BYTES = 16_384
HELD_BYTES = 65_536
"""So much waits here; then whoever sends has to wait, as at a full line."""


@dataclass(slots=True)
class Throttle:
    """bytes_per_s None: as fast as it goes. What was not used is no credit for later."""

    bytes_per_s: float | None = None
    _free_s: float = 0.0

    def room(self, now_s: float) -> int:
        """Bytes that may pass now."""
        return CHUNK_BYTES if self.bytes_per_s is None or now_s >= self._free_s else 0

    def passed(self, count: int, now_s: float) -> None:
        if self.bytes_per_s is not None:
            self._free_s = max(now_s, self._free_s) + count / self.bytes_per_s


@dataclass(slots=True)
class Way:
    """From `source` to `sink`, both non-blocking. Ended: there was an end, and it was passed on."""

    source: socket.socket
    sink: socket.socket
    throttle: Throttle
    has_ended: bool = False
    _waiting: deque[tuple[float, bytes]] = field(default_factory=deque)
    _bytes: int = 0
    _no_more: bool = False

    def wants(self) -> bool:
        """Whether anything that comes would be taken."""
        return not self._no_more and self._bytes < HELD_BYTES

    def holds(self) -> bool:
        """Whether something waits to be passed on."""
        return bool(self._waiting) or (self._no_more and not self.has_ended)

    def take(self, due_s: float) -> None:
        """What there is; it is passed on when it is due. Raises OSError."""
        try:
            received = self.source.recv(CHUNK_BYTES)
        except BlockingIOError:
            return
        if received:
            self._waiting.append((due_s, received))
            self._bytes += len(received)
        else:
            self._no_more = True

    def give(self, now_s: float) -> None:
        """What is due, as far as the sink takes it. Raises OSError."""
        while self._waiting and self._waiting[0][0] <= now_s:
            room = self.throttle.room(now_s)
            if not room or not self._send(room, now_s):
                return
        if self._no_more and not self._waiting and not self.has_ended:
            self.sink.shutdown(socket.SHUT_WR)
            self.has_ended = True

    def _send(self, room: int, now_s: float) -> bool:
        """Whether anything went out."""
        due_s, content = self._waiting[0]
        if self.throttle.bytes_per_s is not None:
            # In small portions: one large one would make all others late at once.
            room = min(room, max(1, int(self.throttle.bytes_per_s / 20.0)))
        try:
            count = self.sink.send(content[:room])
        except BlockingIOError:
            return False
        self.throttle.passed(count, now_s)
        self._bytes -= count
        if count == len(content):
            self._waiting.popleft()
        else:
            self._waiting[0] = due_s, content[count:]
        return True
