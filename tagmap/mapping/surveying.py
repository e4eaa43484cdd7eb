"""Positions of tags that people measured: what is acceptable, and which of two counts."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from tagmap.conventions import TAG_ID
from tagmap.errors import RecordRefused
from tagmap.records.base import LARGEST, LEAST_VARIANCE

Source: TypeAlias = Literal["operator", "memory"]


@dataclass(frozen=True, slots=True)
class SurveyedPosition:
    """`p_m` is always (x, y, z) in map, whatever the kind of the site: a plane ignores z.

    sigma_m  standard deviation per axis
    cov      packed 3x3 where the axes differ; sigma_m is then the largest
    source   an operator, or the tag's own memory, in which robot `read_by` found it
    """

    tag: str
    p_m: tuple[float, float, float]
    sigma_m: float
    cov: tuple[float, ...] | None = None
    source: Source = "operator"
    read_by: str | None = None

    @property
    def covariance(self) -> tuple[float, ...]:
        """Packed 3x3."""
        variance = self.sigma_m * self.sigma_m
        return self.cov or (variance, 0.0, 0.0, variance, 0.0, variance)


@dataclass(slots=True)
class Surveys:
    """All surveys by tag: told by operators, and remembered by the tags themselves."""

    told: dict[str, SurveyedPosition] = field(default_factory=dict)
    remembered: dict[str, SurveyedPosition] = field(default_factory=dict)

    @property
    def in_force(self) -> dict[str, SurveyedPosition]:
        """One for each tag: what was told wins, whenever it was."""
        return self.remembered | self.told


def surveyed(tag: object, p_m: Sequence[object], sigma_m: object) -> SurveyedPosition:
    """Raise RecordRefused, naming what is wrong with it."""
    if not (isinstance(tag, str) and re.fullmatch(TAG_ID, tag)):
        raise RecordRefused(f"tag is {str(tag)[:40]!r}, expected a tag id such as 'e2801160'")
    if len(p_m) != 3:
        raise RecordRefused(f"a position of {len(p_m)} numbers, expected x, y, z in m")
    x, y, z = (_finite(name, value) for name, value in zip("xyz", p_m, strict=True))
    sigma = _finite("sigma", sigma_m)
    least = math.sqrt(LEAST_VARIANCE)
    if not sigma >= least:
        raise RecordRefused(f"sigma is {sigma:g} m, expected at least {least:g}")
    return SurveyedPosition(tag, (x, y, z), sigma)


def _finite(name: str, value: object) -> float:
    number = float(value) if isinstance(value, int | float) else math.nan
    if not abs(number) <= LARGEST:
        shown = str(value)[:40]
        raise RecordRefused(f"{name} is {shown!r}, expected a finite number of m up to {LARGEST:g}")
    return number
