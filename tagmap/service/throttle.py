"""A flood of equal events is counted, not logged."""

from collections import Counter
from dataclasses import dataclass, field

WINDOW_S = 10.0
BURST = 20


@dataclass(slots=True)
class Throttle:
    """Lets `BURST` events of a name pass in `WINDOW_S`; counts the others."""

    until_s: float = 0.0
    seen: Counter[str] = field(default_factory=Counter)

    def allows(self, name: str) -> bool:
        self.seen[name] += 1
        return self.seen[name] <= BURST

    def turn(self, now_s: float) -> dict[str, int]:
        """At the end of a window: how many events of each name were held back in it."""
        if now_s < self.until_s:
            return {}
        held = {name: count - BURST for name, count in self.seen.items() if count > BURST}
        self.seen.clear()
        self.until_s = now_s + WINDOW_S
        return held
