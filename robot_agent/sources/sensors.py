"""Observations of a robot that senses: its cycle hands them over, the shell takes them."""

from collections import deque
from collections.abc import Callable, Sequence
from itertools import islice

from msgspec.structs import replace

from robot_agent.sources import Source
from tagmap.records import Introduction, Observation

MOST_WAITING = 4096
"""Half an hour and more of a robot that drives."""


class SensorSource(Source):
    """One session long: there is nothing to resume. `put` and `end` may be called from any
    thread; `wake` ends the waiting of whoever takes.

    `dropped`: how many there was no more room for, while nobody took any. Odometry leads from one
    to the next, so none leads to the one after them.
    """

    patient = False
    pause_s = 0.25

    def __init__(
        self, introduction: Introduction, session: str, wake: Callable[[], None] = lambda: None
    ) -> None:
        self._wake = wake
        self._introduction = introduction
        self._session = session
        self._waiting: deque[Observation] = deque()
        self._ended = False
        self.dropped = 0
        self._is_gap = False

    @property
    def introduction(self) -> Introduction:
        return self._introduction

    @property
    def fingerprint(self) -> str:
        return f"sensors-{self._session}"

    @property
    def exhausted(self) -> bool:
        return self._ended and not self._waiting

    def put(self, observation: Observation) -> None:
        if len(self._waiting) >= MOST_WAITING:
            self.dropped, self._is_gap = self.dropped + 1, True
            return
        if self._is_gap:
            observation, self._is_gap = replace(observation, odom=None), False
        self._waiting.append(observation)
        self._wake()

    def end(self) -> None:
        self._ended = True
        self._wake()

    def seek(self, position: int) -> None:
        """A new session begins at its beginning."""

    def take(self, limit: int, now_ns: int) -> Sequence[Observation]:  # noqa: ARG002
        count = min(limit, len(self._waiting))
        taken = list(islice(self._waiting, count))
        for _ in taken:
            self._waiting.popleft()
        return taken
