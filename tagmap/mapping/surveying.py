"""Positions of tags that people measured: what is acceptable."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from tagmap.conventions import TAG_ID
from tagmap.errors import RecordRefused
from tagmap.records.base import LARGEST, LEAST_VARIANCE


@dataclass(frozen=True, slots=True)
class SurveyedPosition:
    """`p_m` is always (x, y, z) in map, whatever the kind of the site: a plane ignores z.

    `sigma_m` is the standard deviation per axis.
    """

    tag: str
    p_m: tuple[float, float, float]
    sigma_m: float


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
