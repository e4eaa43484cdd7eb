"""What can go wrong between a camera server and its client."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from fleet.emulation.llrp.line import Line
from fleet.simulation.scene import chance
from robot_agent.cameras.camera import StereoPair

Pieces: TypeAlias = Sequence[bytes | memoryview]


@dataclass(slots=True)
class CameraFaults:
    """Every so many pairs, counted over all clients, one goes wrong; 0: none does.

    cut: the first half is sent, then the server hangs up. stall: the first half is sent, and
    nothing more to this client. wrong_size: the left image lacks its last column. garbage: other
    bytes instead of it.
    """

    cut_every: int = 0
    stall_every: int = 0
    wrong_size_every: int = 0
    garbage_every: int = 0
    seed: int = 0
    _sent: int = 0

    def spoil_pair(self, pair: StereoPair) -> StereoPair:
        """Before it is encoded; counts it."""
        self._sent += 1
        return (
            replace(pair, left=pair.left[:, :-1]) if self._is_turn(self.wrong_size_every) else pair
        )

    def spoil(self, pieces: Pieces) -> tuple[Pieces, Line]:
        """What is sent of it, and what becomes of the line."""
        length = sum(map(len, pieces))
        if self._is_turn(self.cut_every):
            return _first(pieces, length // 2), Line.CUT
        if self._is_turn(self.stall_every):
            return _first(pieces, length // 2), Line.MUTE
        if self._is_turn(self.garbage_every):
            return [self._garbage(min(length, 4096))], Line.OPEN
        return pieces, Line.OPEN

    def _is_turn(self, every: int) -> bool:
        return every > 0 and self._sent % every == 0

    def _garbage(self, length: int) -> bytes:
        return bytes(chance.bits(self.seed, self._sent, i) & 0xFF for i in range(length))


def _first(pieces: Pieces, length: int) -> Pieces:
    kept: list[bytes | memoryview] = []
    for piece in pieces:
        kept.append(piece[:length])
        length -= len(kept[-1])
    return kept
