"""What can go wrong on a serial line."""

from dataclasses import dataclass

from fleet.simulation.scene import chance


@dataclass(slots=True)
class SerialFaults:
    """Every so many answers one goes wrong; 0: none does.

    garbage: other bytes instead of it. half: its first half only. mute: nothing. noise: one byte
    of it is another.
    """

    garbage_every: int = 0
    half_every: int = 0
    mute_every: int = 0
    noise_every: int = 0
    seed: int = 0
    _sent: int = 0

    def spoil(self, content: bytes) -> bytes:
        self._sent += 1
        if self._is_turn(self.mute_every):
            return b""
        if self._is_turn(self.half_every):
            return content[: len(content) // 2]
        if self._is_turn(self.garbage_every):
            return bytes(self._bits(i) & 0xFF for i in range(len(content)))
        if self._is_turn(self.noise_every):
            at = self._bits(0) % len(content)
            return content[:at] + bytes([self._bits(1) & 0xFF]) + content[at + 1 :]
        return content

    def _is_turn(self, every: int) -> bool:
        return every > 0 and self._sent % every == 0

    def _bits(self, i: int) -> int:
        return chance.bits(self.seed, self._sent, i)
