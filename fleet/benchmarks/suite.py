"""A set of metrics and the function that measures them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from statistics import median

from fleet.benchmarks.metric import Metric
from tagmap.errors import DataError


@dataclass(frozen=True, slots=True)
class Plan:
    """How to measure.

    sample  as little as still yields every metric: shows that it works, not how well
    data    the folder of recorded data sets, where there is one
    tell    takes a line of progress
    """

    sample: bool = False
    data: Path | None = None
    tell: Callable[[str], None] = lambda _: None


@dataclass(frozen=True, slots=True)
class Figure:
    """The median of all `runs` in one measurement."""

    runs: tuple[float, ...]

    @property
    def value(self) -> float:
        return median(self.runs)


@dataclass(frozen=True, slots=True)
class Measured:
    """By key: what was measured, and why the rest was not."""

    figures: Mapping[str, Figure]
    skipped: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Suite:
    """`measure` returns the runs of every metric by key, or the reason why there are none."""

    name: str
    about: str
    metrics: tuple[Metric, ...]
    measure: Callable[[Plan], Mapping[str, Sequence[float] | str]]

    def run(self, plan: Plan) -> Measured:
        """Raises TagmapError, also when a metric is missing, unknown, or not a number."""
        found = self.measure(plan)
        keys = {metric.key for metric in self.metrics}
        if keys != set(found):
            raise DataError(f"{self.name}: {sorted(keys ^ set(found))} expected or measured only")
        skipped = {key: runs for key, runs in found.items() if isinstance(runs, str)}
        figures = {key: _figure(key, runs) for key, runs in found.items() if key not in skipped}
        return Measured(figures, skipped)


def load(name: str) -> Suite:
    """One of fleet.benchmarks.NAMES."""
    suite = import_module(f"fleet.benchmarks.{name}").SUITE
    assert isinstance(suite, Suite)
    return suite


def _figure(key: str, runs: Sequence[float] | str) -> Figure:
    numbers = tuple(map(float, runs))
    if not numbers or not all(map(math.isfinite, numbers)):
        raise DataError(f"{key}: measured {numbers}, expected finite numbers")
    return Figure(numbers)
