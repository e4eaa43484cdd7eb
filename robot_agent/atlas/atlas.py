"""Which positions of tags to believe, and in which frame they are.

The service writes into tags only what an anchored map says, so a record and an anchored map are in
one frame, that of the site. A floating map is in a frame of its own: with it nothing that was read
in tags may be mixed.

    anchored map         its tags, and the records of those that it does not have
    floating map, none   with records of 3 tags or more those records alone, else the map
"""

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from robot_agent.atlas.served import ServedMap
from tagmap.conventions import Array
from tagmap.errors import RecordRefused
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.scene import TagTable
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import read
from tagmap.records.arrays import covariance, matrix
from tagmap.records.pose import Gauge
from tagmap.records.transform import Transform

LEAST_RECORDS = 3
UNSTATED_SIGMA_M = 0.05
"""Of a record that does not say how well its position is known."""

Positions: TypeAlias = dict[str, tuple[Array, Array]]
"""p_map (3,) and cov (3, 3) by tag."""
Origin: TypeAlias = Literal["service", "memory"]


@dataclass(frozen=True, slots=True)
class Chart:
    """What the robot localises by. `origin` None: nothing is known.

    T_new_old  (4, 4) from the chart before; None: the two have nothing to do with each other
    """

    origin: Origin | None
    gauge: Gauge
    version: int | None
    table: TagTable
    catalogue: Catalogue
    T_new_old: Array | None

    def __len__(self) -> int:
        return len(self.table)


@dataclass(slots=True)
class Atlas:
    """`key` and `site_number`: what records have to be signed with, and marked with."""

    key: bytes | None = None
    site_number: int | None = None
    served: ServedMap | None = None
    records: dict[str, TagRecord] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    _frame: tuple[Origin | None, Gauge] = (None, "floating")

    def serve(self, served: ServedMap) -> bool:
        """Whether it is another version than the one known."""
        known = self.served
        if known is not None and known.version == served.version and known.tags == served.tags:
            return False
        self.served = served
        return True

    def read(self, tag: str, memory: bytes) -> bool:
        """What was read in a tag: whether it says anything new. Why not, is in `refused`."""
        try:
            contents = read(memory, tag, self.key, self.site_number)
        except RecordRefused as error:
            self.refused[tag] = error.reason
            return self.records.pop(tag, None) is not None
        record = contents.record
        if record is None:
            self.refused[tag] = contents.reason or "no record"
            return self.records.pop(tag, None) is not None
        self.refused.pop(tag, None)
        is_new = self.records.get(tag) != record
        self.records[tag] = record
        return is_new

    def chart(self) -> Chart:
        """Of what is known now; call it once for each change, the chart before is the last one."""
        by_map, by_memory = self._by_map(), self._by_memory()
        origin, gauge, positions = self._chosen(by_map, by_memory)
        before, self._frame = self._frame, (origin, gauge)
        return Chart(
            origin,
            gauge,
            self._version(origin),
            TagTable.of("spatial", positions),
            Catalogue.of(positions),
            self._moved(before, origin, gauge),
        )

    def _chosen(
        self, by_map: Positions, by_memory: Positions
    ) -> tuple[Origin | None, Gauge, Positions]:
        gauge: Gauge = self.served.version.gauge if self.served else "floating"
        if by_map and gauge == "anchored":
            return "service", "anchored", by_memory | by_map
        if len(by_memory) >= LEAST_RECORDS or (by_memory and not by_map):
            return "memory", "anchored", by_memory
        return ("service", "floating", by_map) if by_map else (None, "floating", {})

    def _by_map(self) -> Positions:
        tags = () if self.served is None else self.served.tags
        return {
            tag.tag: (np.array(tag.p_m), covariance(tag.cov))
            for tag in tags
            if tag.p_m is not None
            and tag.cov is not None
            and len(tag.p_m) == 3
            and tag.state in ("mapped", "surveyed")
        }

    def _by_memory(self) -> Positions:
        retired = set[str]()
        if self.served is not None:
            retired = {tag.tag for tag in self.served.tags if tag.state == "retired"}
        return {
            tag: (np.array(record.p_m), _cov(record))
            for tag, record in self.records.items()
            if not record.retired and tag not in retired
        }

    def _version(self, origin: Origin | None) -> int | None:
        if origin == "service" and self.served is not None:
            return self.served.version.version
        if origin == "memory":
            return max(record.map_version for record in self.records.values())
        return None

    def _moved(
        self, before: tuple[Origin | None, Gauge], origin: Origin | None, gauge: Gauge
    ) -> Array | None:
        """The frame of the site stays; a floating map says by how much it moved."""
        if before[1] == gauge == "anchored":
            return np.eye(4)
        if before == (origin, gauge) == ("service", "floating") and self.served is not None:
            moved = self.served.version.moved
            return matrix(moved) if isinstance(moved, Transform) else None
        return None


def _cov(record: TagRecord) -> Array:
    if record.cov is None:
        return UNSTATED_SIGMA_M**2 * np.eye(3)
    return covariance(record.cov)
