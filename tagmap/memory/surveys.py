"""What people surveyed, as the memories of the tags say it: the newest record of each tag counts.

Readings come late and out of order, so newest is by the rule of the slots and not by arrival. What
is no valid record for this tag, site and key says nothing, and takes nothing back either: a torn
write does not unmeasure a tag.
"""

from dataclasses import dataclass

from tagmap.errors import RecordRefused
from tagmap.memory.provenance import is_survey, objection
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import is_newer, read


@dataclass(frozen=True, slots=True)
class ReadSurvey:
    """Position in map and packed covariance (6) that `robot` was the first to read in the tag."""

    tag: str
    p_m: tuple[float, float, float]
    cov: tuple[float, ...]
    robot: str


class ReadSurveys:
    """`site` and `key` are those of the site; without a number, records of any site count.

    found  by tag, what may be used
    """

    def __init__(self, site: int | None, key: bytes | None) -> None:
        self.found: dict[str, ReadSurvey] = {}
        self._site, self._key = site, key
        self._newest: dict[str, TagRecord] = {}
        self._unusable: dict[str, str] = {}
        self._unreadable: dict[str, str] = {}

    @property
    def refused(self) -> dict[str, str]:
        """By tag, why what it says may not be used: a survey that no map can use, or what was read
        last is no valid record. Blank memories and what maps wrote are neither."""
        return self._unusable | self._unreadable

    def hear(self, tag: str, memory: bytes, robot: str) -> None:
        """All of a tag's memory, as a robot read it."""
        self._unreadable.pop(tag, None)
        if not memory.strip(b"\0") or not memory.strip(b"\xff"):
            return
        try:
            contents = read(memory, tag, self._key, self._site)
        except RecordRefused as error:
            self._unreadable[tag] = error.reason
            return
        record = contents.record
        if record is None:
            self._unreadable[tag] = contents.reason or "no record"
        elif tag not in self._newest or not is_newer(self._newest[tag], record):
            self._newest[tag] = record
            self._judge(tag, record, robot)

    def _judge(self, tag: str, record: TagRecord, robot: str) -> None:
        before = self.found.pop(tag, None)
        self._unusable.pop(tag, None)
        if not is_survey(record):
            return
        reason = objection(record)
        if reason is not None:
            self._unusable[tag] = reason
            return
        assert record.cov is not None
        says = (record.p_m, record.cov)
        if before is None or (before.p_m, before.cov) != says:
            before = ReadSurvey(tag, *says, robot)
        self.found[tag] = before
