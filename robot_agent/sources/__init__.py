"""Where observations come from."""

from collections.abc import Sequence
from typing import Protocol

from tagmap.records import Introduction, Observation


class Source(Protocol):
    """What the shell asks of a source; recordings and live sensors alike."""

    @property
    def introduction(self) -> Introduction: ...

    @property
    def fingerprint(self) -> str:
        """Tells sources apart, so that a position is only resumed in the source it is of."""
        ...

    @property
    def patient(self) -> bool:
        """Whether it can wait until earlier observations are settled, as a recording can."""
        ...

    @property
    def pause_s(self) -> float:
        """How long nobody need look for something new: a source that wakes whoever waits may say
        more than one that has to be asked."""
        ...

    @property
    def exhausted(self) -> bool: ...

    def seek(self, position: int) -> None:
        """Go on after the first `position` observations. Called before the first `take`."""
        ...

    def take(self, limit: int, now_ns: int) -> Sequence[Observation]:
        """At most `limit` observations that are due at `now_ns` (monotonic).

        Raises DataError where the source is damaged; what came before was handed out earlier.
        """
        ...
