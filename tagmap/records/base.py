"""What all records share: the base struct, field types, and the checks made once, at the edge."""

import math
from collections.abc import Sequence
from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

from tagmap.conventions import NAME, SESSION_ID, TAG_ID

VERSION = 1
# No quantity of a site, in SI or px, is larger; no sigma smaller than 1e-9. Squares stay finite.
LARGEST = 1e12
LEAST_VARIANCE = 1e-18

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
    for value in values:
        if not abs(value) <= LARGEST:
            raise ValueError(f"{name} holds {value}, expected finite numbers up to {LARGEST:g}")


def check_covariance(name: str, upper: Sequence[float], size: int) -> None:
    """Raise ValueError unless `upper` is the upper triangle of a positive definite size x size."""
    check_finite(name, upper, [size * (size + 1) // 2])
    if not _is_positive_definite(upper, size):
        raise ValueError(f"{name} is not a positive definite {size}x{size} covariance")


def _is_positive_definite(upper: Sequence[float], n: int) -> bool:
    """Cholesky on the packed upper triangle; relative pivot 1e-12 against rounding."""
    factor: list[list[float]] = []
    start = 0
    for i in range(n):
        row = list(upper[start : start + n - i])
        start += n - i
        diagonal = row[0]
        for k in range(i):
            above = factor[k]
            scale = above[i - k]
            for j in range(n - i):
                row[j] -= scale * above[i - k + j]
        if not row[0] > 1e-12 * diagonal or not diagonal >= LEAST_VARIANCE:
            return False
        root = math.sqrt(row[0])
        factor.append([value / root for value in row])
    return True
