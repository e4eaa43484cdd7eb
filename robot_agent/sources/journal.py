"""Replay of an observation journal: as fast as it is taken, or paced by its own clock."""

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from tagmap.errors import DataError
from tagmap.records import Introduction, Observation
from tagmap.records.journal import read_introduction, read_observations

FINGERPRINT_BYTES = 65536


class JournalSource:
    """Observations of a journal file.

    `speed` 1.0 plays in true time, 2.0 twice as fast; None as fast as the agent takes them.
    """

    def __init__(self, path: Path, speed: float | None = None) -> None:
        self.introduction: Introduction = read_introduction(path)
        self.fingerprint: str = _fingerprint(path)
        self._path = path
        self._speed = speed
        self._observations: Iterator[Observation] = iter(())
        self._next: Observation | None = None
        self._damage: DataError | None = None
        self._started: tuple[int, int] | None = None
        self.seek(0)

    pause_s = 0.02

    @property
    def patient(self) -> bool:
        return self._speed is None

    @property
    def exhausted(self) -> bool:
        return self._next is None and self._damage is None

    def seek(self, position: int) -> None:
        self._observations = read_observations(self._path, skip=position)
        self._advance()

    def take(self, limit: int, now_ns: int) -> Sequence[Observation]:
        taken: list[Observation] = []
        while len(taken) < limit and self._next is not None and self._is_due(self._next, now_ns):
            taken.append(self._next)
            self._advance()
        if self._damage is not None and not taken and self._next is None:
            damage, self._damage = self._damage, None
            raise damage
        return taken

    def _advance(self) -> None:
        """Damage is kept until everything before it was taken."""
        try:
            self._next = next(self._observations, None)
        except DataError as error:
            self._next, self._damage = None, error

    def _is_due(self, observation: Observation, now_ns: int) -> bool:
        if self._speed is None:
            return True
        if self._started is None:
            self._started = (now_ns, observation.t_ns)
        started_ns, first_t_ns = self._started
        return (now_ns - started_ns) * self._speed >= observation.t_ns - first_t_ns


def _fingerprint(path: Path) -> str:
    """Of the head only: a recording is written once, and may be long."""
    with path.open("rb") as file:
        return hashlib.blake2b(file.read(FINGERPRINT_BYTES), digest_size=16).hexdigest()
