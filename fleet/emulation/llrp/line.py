"""What can go wrong between reader and client."""

from dataclasses import dataclass
from enum import Enum

from fleet.simulation.scene import chance


class Line(Enum):
    """OPEN: goes on. CUT: the reader hangs up. MUTE: it says nothing more to this client."""

    OPEN, CUT, MUTE = range(3)


@dataclass(slots=True)
class LineFaults:
    """Every so many messages, counted over all clients, one goes wrong; 0: none does.

    cut: half of it is sent, then the reader hangs up. garbage: as many other bytes instead of it.
    mute: neither it nor anything else is sent until the client goes.
    """

    cut_every: int = 0
    garbage_every: int = 0
    mute_every: int = 0
    seed: int = 0
    _sent: int = 0

    def spoil(self, content: bytes) -> tuple[bytes, Line]:
        """What is sent of a message, and what becomes of the line."""
        self._sent += 1
        if self._is_turn(self.cut_every):
            return content[: len(content) // 2], Line.CUT
        if self._is_turn(self.mute_every):
            return b"", Line.MUTE
        if self._is_turn(self.garbage_every):
            return self._garbage(len(content)), Line.OPEN
        return content, Line.OPEN

    def _is_turn(self, every: int) -> bool:
        return every > 0 and self._sent % every == 0

    def _garbage(self, length: int) -> bytes:
        return bytes(chance.bits(self.seed, self._sent, i) & 0xFF for i in range(length))
