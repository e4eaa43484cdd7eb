"""When to try again what failed."""

from dataclasses import dataclass

FIRST_S = 0.25
LONGEST_S = 8.0


@dataclass(slots=True)
class Backoff:
    """Twice as long after each failure, up to LONGEST_S; no wait after a success. `now_s` is of
    any clock that only goes forward."""

    _pause_s: float = 0.0
    _until_s: float = 0.0

    def failed(self, now_s: float) -> None:
        self._pause_s = min(max(FIRST_S, 2.0 * self._pause_s), LONGEST_S)
        self._until_s = now_s + self._pause_s

    def succeeded(self) -> None:
        self._pause_s = 0.0
        self._until_s = 0.0

    def wait_s(self, now_s: float) -> float:
        return max(0.0, self._until_s - now_s)
