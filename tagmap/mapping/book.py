"""The map as it is served: the newest version, its tags, and how a solution becomes the next."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tagmap.conventions import Array, Form, Kind
from tagmap.geometry.alignment import align
from tagmap.localisation.scene import TagTable
from tagmap.mapping.correction import Correction, Found, corrections
from tagmap.records import MapVersion, Tag
from tagmap.records.arrays import covariance, transform, upper, vector
from tagmap.records.base import Vector
from tagmap.records.pose import Gauge

if TYPE_CHECKING:
    from tagmap.estimation.solution import Solution, TagEstimate


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
    """`version` is None until the first map; `table` holds the tags that can be localised by, and
    `scale` the common scales of the sensors, for the forms that have one; `corrections`: what was
    found out of each robot's own.
    """

    version: MapVersion | None = None
    tags: dict[str, Tag] = field(default_factory=dict)
    scale: dict[Form, float] = field(default_factory=dict)
    corrections: dict[str, Correction] = field(default_factory=dict)
    table: TagTable = field(default_factory=lambda: TagTable.of("spatial", {}))

    @property
    def gauge(self) -> Gauge:
        return self.version.gauge if self.version else "floating"

    @property
    def number(self) -> int | None:
        return self.version.version if self.version else None

    def restore(
        self,
        version: MapVersion,
        tags: list[Tag],
        scale: float | None = None,
        stereo_scale: float | None = None,
        calibration: Iterable[Found] = (),
    ) -> None:
        """`scale` is that of ranges and points; None: exact."""
        self.version, self.corrections = version, corrections(calibration)
        self.tags = {tag.tag: tag for tag in tags}
        usable = {tag.tag: _belief(tag.p_m, tag.cov) for tag in tags if _is_usable(tag)}
        d = next((len(p) for p, _ in usable.values()), 3)
        self.table = TagTable.of("spatial" if d == 3 else "planar", usable)
        self.scale = {}
        if scale is not None:
            self.scale |= {"range_bearing": scale, "point_cam_m": scale}
        if stereo_scale is not None:
            self.scale["stereo_px"] = stereo_scale

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
        scales = solution.scale, solution.stereo_scale
        self.restore(version, tags, *scales, solution.calibration)
        return Edition(version, tags, changed, T_new_old)


def _tag(estimate: "TagEstimate", version: int, gauge: Gauge) -> Tag:
    return Tag(
        tag=estimate.tag,
        p_m=None if estimate.p is None else vector(estimate.p),
        cov=None if estimate.cov is None else upper(estimate.cov),
        state="withheld" if estimate.p is None else estimate.state,
        n=int(estimate.n),
        version=version,
        gauge=gauge,
    )


def _is_usable(tag: Tag) -> bool:
    return tag.p_m is not None and tag.cov is not None and tag.state in ("mapped", "surveyed")


def _belief(p_m: Vector | None, cov: Vector | None) -> tuple[Array, Array]:
    assert p_m is not None
    assert cov is not None
    return np.array(p_m), covariance(cov)


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
