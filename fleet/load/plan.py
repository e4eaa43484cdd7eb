"""What load is wanted, and what of it is no sense."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from tagmap.errors import ConfigError
from tagmap.records import Hello, Keyframe

MOST_KEYFRAMES = 2_000_000


class Source(Protocol):
    """One robot's keyframes, a stretch at a time; fewer than asked for where there are no more."""

    @property
    def hello(self) -> Hello: ...

    def drive(self, count: int, rate_hz: float) -> Iterator[Keyframe]: ...


@dataclass(frozen=True, slots=True)
class Load:
    """Keyframes of each of `sources` at `rate_hz` for `duration_s`. seed: of the phases in which
    they send; about: of the sources, for the report. ConfigError where that is too much to hold.
    """

    sources: Sequence[Source]
    rate_hz: float
    duration_s: float
    seed: int
    about: dict[str, object]

    def __post_init__(self) -> None:
        require_holdable(len(self.sources), self.rate_hz, self.duration_s)

    @property
    def count(self) -> int:
        """Keyframes of each robot."""
        return max(1, round(self.rate_hz * self.duration_s))


def require_holdable(robots: int, rate_hz: float, duration_s: float) -> None:
    """They are made before, so that making them takes nothing from the service."""
    wanted = robots * rate_hz * duration_s
    if wanted > MOST_KEYFRAMES:
        raise ConfigError(
            f"{robots} robots at {rate_hz:g} Hz for {duration_s:g} s are {wanted:.0f} keyframes, "
            f"at most {MOST_KEYFRAMES} are held in memory"
        )
