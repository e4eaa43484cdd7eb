"""Which positions of tags to believe, and in which frame they are.

The service writes into tags only what an anchored map says, so a record and an anchored map are in
one frame, that of the site. A floating map is in a frame of its own: with it nothing that was read
in tags may be mixed.

    anchored map         its tags, and the records of those that it does not have
    floating map, none   with records of 3 tags or more those records alone, else the map
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from robot_agent.atlas.moving import between, is_one_frame
from robot_agent.atlas.served import ServedMap
from robot_agent.atlas.sound import Positions, places_of
from tagmap.conventions import Array
from tagmap.errors import RecordRefused
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.scene import TagTable
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import read
from tagmap.records.arrays import covariance
from tagmap.records.pose import Gauge

LEAST_RECORDS = 3
UNSTATED_SIGMA_M = 0.05
"""Of a record that does not say how well its position is known."""

Origin: TypeAlias = Literal["service", "memory"]


@dataclass(frozen=True, slots=True)
class Chart:
    """What the robot localises by. `origin` None: nothing is known.

    T_new_old  (4, 4) from the chart before; None: the two have nothing to do with each other
    left_out   tags of the map that are not to be localised by though it says so, and why
    """

    origin: Origin | None
    gauge: Gauge
    version: int | None
    table: TagTable
    catalogue: Catalogue
    T_new_old: Array | None
    left_out: Mapping[str, str] = field(default_factory=dict)

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
    _by_map: Positions = field(default_factory=dict)
    _left_out: dict[str, str] = field(default_factory=dict)
    _last: Chart | None = None

    def serve(self, served: ServedMap) -> bool:
        """Whether it is another version than the one known."""
        known = self.served
        if known is not None and known.version == served.version and known.tags == served.tags:
            return False
        self.served = served
        self._by_map, self._left_out = places_of(served.tags)
        return True

    def read(self, tag: str, memory: bytes) -> bool:
        """What was read in a tag: whether it says anything new of where tags are. Why it counts
        for nothing, is in `refused`."""
        is_new = self._keep(tag, memory)
        return is_new and not (self._gauge() == "anchored" and tag in self._by_map)

    def _keep(self, tag: str, memory: bytes) -> bool:
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
        origin, gauge, positions = self._chosen(self._by_map, self._by_memory())
        table, version = TagTable.of("spatial", positions), self._version(origin)
        T_new_old = self._moved(origin, gauge, table)
        catalogue = Catalogue.of(positions)
        self._last = Chart(origin, gauge, version, table, catalogue, T_new_old, self._left_out)
        return self._last

    def _gauge(self) -> Gauge:
        return self.served.version.gauge if self.served else "floating"

    def _chosen(
        self, by_map: Positions, by_memory: Positions
    ) -> tuple[Origin | None, Gauge, Positions]:
        if by_map and self._gauge() == "anchored":
            return "service", "anchored", by_memory | by_map
        if len(by_memory) >= LEAST_RECORDS or (by_memory and not by_map):
            return "memory", "anchored", by_memory
        return ("service", "floating", by_map) if by_map else (None, "floating", {})

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

    def _moved(self, origin: Origin | None, gauge: Gauge, table: TagTable) -> Array | None:
        """The frame of the site stays, unless its survey was changed. Other frames move from one
        version to the next, and are others with another database: the tags know."""
        last = self._last
        if last is None or last.origin is None or origin is None:
            return None
        if last.gauge == gauge == "anchored" and is_one_frame(last.table, table):
            return np.eye(4)
        return between(last.table, table) if origin == last.origin == "service" else None


def _cov(record: TagRecord) -> Array:
    if record.cov is None:
        return UNSTATED_SIGMA_M**2 * np.eye(3)
    return covariance(record.cov)
