"""The user memory of one tag, which can be locked and wears out."""

from collections.abc import Iterable
from typing import Literal, TypeAlias

Denial: TypeAlias = Literal["overrun", "locked"]
ENDURANCE = 100_000
LARGEST_WORD = 0xFFFF


class UserMemory:
    """Words of 16 bits. A word written more than `endurance` times keeps what it has: the tag
    acknowledges, only reading back shows it."""

    def __init__(
        self, words: Iterable[int], *, locked: bool = False, endurance: int = ENDURANCE
    ) -> None:
        self.locked = locked
        self._words = list(words)
        self._writes = [0] * len(self._words)
        self._endurance = endurance

    @property
    def words(self) -> tuple[int, ...]:
        return tuple(self._words)

    @property
    def writes(self) -> int:
        """Of the word that was written most often."""
        return max(self._writes, default=0)

    def restore(self, words: Iterable[int]) -> None:
        """What it held before the power went; wears nothing."""
        self._words = list(words)

    def write(self, address: int, word: int) -> Denial | None:
        """None: acknowledged. `word` is 0 to 65535."""
        if not 0 <= address < len(self._words):
            return "overrun"
        if self.locked:
            return "locked"
        self._writes[address] += 1
        if self._writes[address] <= self._endurance:
            self._words[address] = word & LARGEST_WORD
        return None
