"""Without the service: listen before shooting, and give way at random (carrier sense)."""

from dataclasses import dataclass

import numpy as np

from tagmap.arbitration.rules import SECOND_NS


@dataclass(slots=True)
class Listening:
    """quiet_s    nothing must have been heard for so long
    window_s   of the random wait after something was heard; doubles up to `most_s` each time
    begin_ns   not to begin before
    waits      how often we gave way since our last turn
    """

    begin_ns: int
    quiet_s: float = 0.2
    window_s: float = 0.5
    most_s: float = 8.0
    waits: int = 0

    @classmethod
    def start(cls, now_ns: int) -> "Listening":
        listening = cls(now_ns)
        listening.begin_ns += round(listening.quiet_s * SECOND_NS)
        return listening

    def heard(self, now_ns: int, rng: np.random.Generator) -> None:
        """Somebody's tag answers while our laser is off."""
        window_s = min(self.most_s, self.window_s * 2.0 ** min(self.waits, 16))
        self.waits += 1
        wait_s = self.quiet_s + rng.uniform(0.0, window_s)
        self.begin_ns = max(self.begin_ns, now_ns + round(wait_s * SECOND_NS))

    def may_begin(self, now_ns: int) -> bool:
        return now_ns >= self.begin_ns

    def end_turn(self, now_ns: int, rng: np.random.Generator) -> None:
        """After our round: the others first, for a random while."""
        self.waits = 0
        wait_s = self.quiet_s + rng.uniform(0.0, self.window_s)
        self.begin_ns = now_ns + round(wait_s * SECOND_NS)
