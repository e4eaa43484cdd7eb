"""What all tables of a scenario share: the base, and the types of their keys."""

from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta


class Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the file; an unknown key is refused, for it would silently mean its default."""


Metres: TypeAlias = Annotated[float, Meta(ge=-1e4, le=1e4)]
Length: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e4)]
Sigma: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e3)]
Rate: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e9)]
Chance: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Seconds: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e6)]
Degrees: TypeAlias = Annotated[float, Meta(ge=-360.0, le=360.0)]
Count: TypeAlias = Annotated[int, Meta(ge=1, le=10_000)]
Seed: TypeAlias = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Hex: TypeAlias = Annotated[str, Meta(pattern=r"^([0-9a-f]{4}){1,31}$(?!\n)")]

Point2: TypeAlias = tuple[Metres, Metres]
Point3: TypeAlias = tuple[Metres, Metres, Metres]
Size2: TypeAlias = tuple[Length, Length]
Size3: TypeAlias = tuple[Length, Length, Length]
TagRef: TypeAlias = Annotated[int, Meta(ge=1)] | Hex
"""The number of a tag in the order of the file, from 1, or its EPC."""
