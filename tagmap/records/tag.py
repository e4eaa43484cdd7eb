"""The map as it is served: tags, and the versions they belong to."""

from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from tagmap.records.base import Message, TagId, TimeNs, Vector
from tagmap.records.pose import Gauge
from tagmap.records.transform import Transform

TagState: TypeAlias = Literal["mapped", "surveyed", "withheld", "retired"]


class Tag(Message, frozen=True, kw_only=True):
    """One tag in one map version.

    p_m, cov  position in map, 3 (6) numbers in space, 2 (3) in the plane; null while withheld,
              that is while no chain of sightings ties the tag to the gauge
    n         sightings that carry its position
    """

    tag: TagId
    p_m: Vector | None
    cov: Vector | None
    state: TagState
    n: Annotated[int, Meta(ge=0)]
    version: int
    gauge: Gauge


class MapVersion(Message, frozen=True, kw_only=True):
    """A version of the map. `moved`: the rigid transform T_new_old from the version before."""

    version: int
    t_ns: TimeNs
    cause: str
    gauge: Gauge
    moved: Transform | None
    tags: int
    withheld: int
