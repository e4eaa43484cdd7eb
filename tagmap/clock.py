"""What a shell asks for the time, so that it can also live in another time than the machine's."""

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Clock:
    """The machine's clocks, unless others are given.

    monotonic_ns  never goes back; means nothing to anybody else
    utc_ns        what messages and the database carry
    """

    monotonic_ns: Callable[[], int] = time.monotonic_ns
    utc_ns: Callable[[], int] = time.time_ns

    def monotonic_s(self) -> float:
        return self.monotonic_ns() / 1e9
