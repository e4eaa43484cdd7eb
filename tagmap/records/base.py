"""What all records share: the base struct, field types, and the checks made once, at the edge."""

from collections.abc import Sequence
from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

from tagmap.conventions import NAME, SESSION_ID, TAG_ID

VERSION = 1
# No quantity of a site, in SI or px, is larger; no sigma smaller than 1e-9. Squares stay finite.
LARGEST = 1e12
LEAST_VARIANCE = 1e-18
# Of a covariance, relative to its diagonal: what is less may be rounding.
_LEAST_PIVOT = 1e-12

Name: TypeAlias = Annotated[str, Meta(pattern=NAME)]
TagId: TypeAlias = Annotated[str, Meta(pattern=TAG_ID)]
SessionId: TypeAlias = Annotated[str, Meta(pattern=SESSION_ID)]
RobotNumber: TypeAlias = Annotated[int, Meta(ge=1, le=65535)]
Seq: TypeAlias = Annotated[int, Meta(ge=0, le=2**53)]
TimeNs: TypeAlias = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Probability: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Finite: TypeAlias = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
Positive: TypeAlias = Annotated[float, Meta(gt=0.0, le=LARGEST)]
NotNegative: TypeAlias = Annotated[float, Meta(ge=0.0, le=LARGEST)]
Vector: TypeAlias = tuple[Finite, ...]


class Record(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """A fact in named fields. Unknown fields are ignored, so old readers understand new writers.

    Facts refer to no facts, so the collector need not look at them: at a service that remembers
    thousands of keyframes it would stop the loop for 0.1 s.
    """


class Message(Record, frozen=True, kw_only=True):
    """A record that travels by itself and therefore names its schema version; see codec.decode."""

    v: int = VERSION


def check_finite(name: str, values: Sequence[float], lengths: Sequence[int]) -> None:
    """Raise ValueError unless `values` has one of `lengths` and holds finite numbers only."""
    if len(values) not in lengths:
        expected = " or ".join(map(str, lengths))
        raise ValueError(f"{name} has {len(values)} numbers, expected {expected}")
    if not all(map(LARGEST.__ge__, map(abs, values))):
        bad = next(value for value in values if not abs(value) <= LARGEST)
        raise ValueError(f"{name} holds {bad}, expected finite numbers up to {LARGEST:g}")


def check_covariance(name: str, upper: Sequence[float], size: int) -> None:
    """Raise ValueError unless `upper` is the upper triangle of a positive definite size x size."""
    check_finite(name, upper, [size * (size + 1) // 2])
    if not _is_positive_definite(upper, size):
        raise ValueError(f"{name} is not a positive definite {size}x{size} covariance")


def _is_positive_definite(upper: Sequence[float], n: int) -> bool:
    """Every pivot of the packed upper triangle, held against its own diagonal for rounding.

    Four are written out: that many come ten times in every keyframe.
    """
    if n == 4:
        diagonals = [upper[0], upper[4], upper[7], upper[9]]
    else:
        diagonals = [upper[i * n - i * (i - 1) // 2] for i in range(n)]
    if not min(diagonals) >= LEAST_VARIANCE:
        return False
    rest = upper
    while n != 4:
        if not rest[0] > _LEAST_PIVOT * diagonals[-n]:
            return False
        if n == 1:
            return True
        rest, n = _eliminated(rest, n), n - 1
    return _are_four_pivots(rest, *diagonals[-4:])


def _eliminated(upper: Sequence[float], n: int) -> list[float]:
    """What is left of an n x n triangle without its first row."""
    row, rest = upper[:n], list(upper[n:])
    at = 0
    for i in range(1, n):
        scale = row[i] / row[0]
        if scale:
            for j in range(i, n):
                rest[at + j - i] -= scale * row[j]
        at += n - i
    return rest


def _are_four_pivots(upper: Sequence[float], d0: float, d1: float, d2: float, d3: float) -> bool:
    """Of a 4 x 4 triangle; d0 to d3 are the diagonals that its pivots are held against."""
    p0, b, c, d, p1, f, g, p2, i, p3 = upper
    if not p0 > _LEAST_PIVOT * d0:
        return False
    s, t = b / p0, c / p0
    p1, f, g, p2, i, p3 = p1 - s * b, f - s * c, g - s * d, p2 - t * c, i - t * d, p3 - d / p0 * d
    if not p1 > _LEAST_PIVOT * d1:
        return False
    s = f / p1
    p2, i, p3 = p2 - s * f, i - s * g, p3 - g / p1 * g
    return p2 > _LEAST_PIVOT * d2 and p3 - i / p2 * i > _LEAST_PIVOT * d3
