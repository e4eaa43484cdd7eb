"""What a benchmark measures."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

Direction: TypeAlias = Literal["lower", "higher"]

TIME_UNITS = ("s", "ms", "1/s")


@dataclass(frozen=True, slots=True)
class Metric:
    """One figure. `key` is unique in its suite; `unit` "x" is a ratio of times.

    direction  which way is better
    tolerance  how much worse than the baseline it may become, as a share; None: never compared.
               Times of two machines have nothing to say to each other, so they cannot have one.
    reach      what the product promises; of times it is shown only
    """

    key: str
    unit: str
    direction: Direction
    about: str
    tolerance: float | None = None
    reach: float | None = None

    def __post_init__(self) -> None:
        if self.tolerance is not None and self.is_time:
            raise ValueError(f"{self.key} is in {self.unit}: compare a ratio instead")

    @property
    def is_time(self) -> bool:
        return self.unit in TIME_UNITS

    @property
    def is_speed(self) -> bool:
        """Of a machine as well as of the program: a ratio of times still depends on its caches."""
        return self.is_time or self.unit == "x"

    def reaches(self, value: float) -> bool:
        if self.reach is None:
            return True
        return value <= self.reach if self.direction == "lower" else value >= self.reach

    def worse_by(self, value: float, baseline: float) -> float:
        """Share by which `value` is worse than `baseline`; negative when it is better."""
        better, worse = (baseline, value) if self.direction == "lower" else (value, baseline)
        if better == worse:
            return 0.0
        return worse / better - 1.0 if better > 0.0 else float("inf")
