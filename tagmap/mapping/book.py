"""The map as it is served: the newest version, its tags, and how a solution becomes the next."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tagmap.conventions import Array, Kind
from tagmap.geometry.alignment import align
from tagmap.geometry.covariance import pack_upper, unpack_upper
from tagmap.records import MapVersion, Tag
from tagmap.records.arrays import transform
from tagmap.records.base import Vector
from tagmap.records.pose import Gauge

if TYPE_CHECKING:
    from tagmap.estimation.solve import Solution, TagEstimate


@dataclass(frozen=True, slots=True)
class TagBelief:
    """A tag that can be used for localisation: p_map_tag (D,), cov_map_tag (D, D)."""

    p: Array
    cov: Array


@dataclass(frozen=True, slots=True)
class Edition:
    """A map version with all its tags, and those of them that differ from the version before.

    `T_new_old` (d, d) is None for the first version and where the tags in common do not fix it.
    """

    version: MapVersion
    tags: list[Tag]
    changed: list[Tag]
    T_new_old: Array | None


@dataclass(slots=True)
class MapBook:
    """`version` is None until the first map."""

    version: MapVersion | None = None
    tags: dict[str, Tag] = field(default_factory=dict)
    beliefs: dict[str, TagBelief] = field(default_factory=dict)

    @property
    def gauge(self) -> Gauge:
        return self.version.gauge if self.version else "floating"

    @property
    def number(self) -> int | None:
        return self.version.version if self.version else None

    def restore(self, version: MapVersion, tags: list[Tag]) -> None:
        self.version = version
        self.tags = {tag.tag: tag for tag in tags}
        self.beliefs = {tag.tag: _belief(tag.p_m, tag.cov) for tag in tags if _is_usable(tag)}

    def adopt(self, solution: "Solution", cause: str, now_ns: int) -> Edition:
        """Turn to the next version."""
        number = (self.number or 0) + 1
        tags = [_tag(estimate, number, solution.gauge) for estimate in solution.tags]
        T_new_old = _moved(self.tags, {tag.tag: tag for tag in tags}, solution.kind)
        version = MapVersion(
            version=number,
            t_ns=now_ns,
            cause=cause,
            gauge=solution.gauge,
            moved=None if T_new_old is None else transform(T_new_old),
            tags=sum(tag.state != "withheld" for tag in tags),
            withheld=sum(tag.state == "withheld" for tag in tags),
        )
        changed = [tag for tag in tags if _differs(tag, self.tags.get(tag.tag))]
        self.restore(version, tags)
        return Edition(version, tags, changed, T_new_old)


def _tag(estimate: "TagEstimate", version: int, gauge: Gauge) -> Tag:
    withheld = estimate.state == "withheld" or estimate.p is None
    return Tag(
        tag=estimate.tag,
        p_m=None if withheld else tuple(map(float, estimate.p)),
        cov=None if withheld or estimate.cov is None else _packed(estimate.cov),
        state="withheld" if withheld else estimate.state,
        n=int(estimate.n),
        version=version,
        gauge=gauge,
    )


def _packed(cov: Array) -> Vector:
    return tuple(map(float, pack_upper(cov) if cov.ndim == 2 else cov))


def _is_usable(tag: Tag) -> bool:
    return tag.p_m is not None and tag.cov is not None and tag.state in ("mapped", "surveyed")


def _belief(p_m: Vector | None, cov: Vector | None) -> TagBelief:
    assert p_m is not None
    assert cov is not None
    return TagBelief(np.array(p_m), unpack_upper(np.array(cov), len(p_m)))


def _differs(tag: Tag, before: Tag | None) -> bool:
    if before is None:
        return True
    return (tag.p_m, tag.cov, tag.state, tag.n, tag.gauge) != (
        before.p_m,
        before.cov,
        before.state,
        before.n,
        before.gauge,
    )


def _moved(old: Mapping[str, Tag], new: Mapping[str, Tag], kind: Kind) -> Array | None:
    """T_new_old that takes the old positions of the tags in common to the new ones, if they do."""
    common = [
        (before.p_m, new[tag].p_m)
        for tag, before in old.items()
        if tag in new and before.p_m is not None and new[tag].p_m is not None
    ]
    if len(common) < (3 if kind == "spatial" else 2):
        return None
    p_old, p_new = np.array(common).transpose(1, 0, 2)
    alignment = align(p_old, p_new, None)
    return alignment.T_b_a if alignment.determined else None
