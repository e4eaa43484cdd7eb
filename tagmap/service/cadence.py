"""When to solve: often enough to be current, rarely enough to leave the machine alone."""

from dataclasses import dataclass

INTERVAL_S = 2.0
# Times as long as it solved: a tenth of a core.
SHARE = 9.0
# With the rest the work of the next solve grows: what comes meanwhile must be taken in, too.
LONGEST_REST_S = 15.0
LONGEST_PAUSE_S = 60.0


@dataclass(slots=True)
class Cadence:
    """Counts generations of facts: `have` is committed, `solved` is in the map.

    A solve starts when there is something new and `INTERVAL_S` or `SHARE` times the last solve's
    duration, `LONGEST_REST_S` at most, has passed since it ended, or at once when it is `wanted`.
    Failures double the pause.
    """

    have: int = 0
    solved: int = 0
    running: int | None = None
    wanted: bool = False
    rest_until_s: float = 0.0
    failures: int = 0
    started_s: float = 0.0

    def changed(self) -> None:
        self.have += 1

    def want(self) -> int:
        """Ask for a solve now; returns the generation that it will cover."""
        self.wanted = True
        return self.have

    def is_due(self, now_s: float) -> bool:
        if self.running is not None or self.solved >= self.have:
            return False
        return (self.wanted and not self.failures) or now_s >= self.rest_until_s

    def start(self, now_s: float) -> None:
        self.running, self.started_s = self.have, now_s
        self.wanted = False

    def finish(self, now_s: float) -> None:
        assert self.running is not None
        self.solved, self.running, self.failures = self.running, None, 0
        rest_s = min(SHARE * (now_s - self.started_s), LONGEST_REST_S)
        self.rest_until_s = now_s + max(INTERVAL_S, rest_s)

    def fail(self, now_s: float) -> None:
        """What was running is void: it will be due again after a pause."""
        self.running = None
        self.failures += 1
        self.rest_until_s = now_s + min(LONGEST_PAUSE_S, INTERVAL_S * 2.0**self.failures)
