"""What a tag's memory should say, and whether what it says is near enough."""

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

from tagmap.errors import RecordRefused
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import encode_for, read
from tagmap.memory.writing import ENDURED_WRITES, plan_write, wear

Need: TypeAlias = Literal["fine", "write", "kept"]

LEAST_DIFFERENCE_M = 0.01
SIGMAS = 2.0


@dataclass(frozen=True, slots=True)
class Owner:
    """Whose memories these are: the number of the site and, where it signs, its key.

    Without a number records of any site are read, and none is written.
    """

    site: int | None
    key: bytes | None = None


@dataclass(frozen=True, slots=True)
class Wanted:
    """One tag as an anchored map has it: position (3,) and packed covariance (6,) in map.

    surveyed  both are the survey's own, untouched by the map: see tagmap.memory.provenance
    """

    p_m: tuple[float, float, float]
    cov: tuple[float, ...]
    map_version: int
    t_s: int
    count: int
    surveyed: bool = False
    retired: bool = False

    def record(self, owner: Owner, robot_number: int) -> TagRecord:
        return TagRecord(
            site=owner.site,
            map_version=self.map_version,
            p_m=self.p_m,
            cov=self.cov,
            t_s=self.t_s,
            robot=robot_number,
            count=self.count,
            surveyed=self.surveyed,
            retired=self.retired,
        )


@dataclass(frozen=True, slots=True)
class Judgement:
    """`fine`: nothing to do. `write`: and why. `kept`: it should say something else, but cannot."""

    need: Need
    reason: str | None = None


FINE = Judgement("fine")


def judge(wanted: Wanted, memory: bytes, tag: str, owner: Owner, writes: int) -> Judgement:
    """Of a memory as it was last read and that was written `writes` times."""
    try:
        contents = read(memory, tag, owner.key, owner.site)
        if contents.record is not None and _is_lost(contents.record, wanted):
            return Judgement("kept", "people surveyed it, and the map does not use that survey")
        difference = _difference(wanted, contents.record) or contents.reason
        if difference is None:
            return FINE
        if owner.site is None:
            return Judgement("kept", f"{difference}; the site has no number to write with")
        data = encode_for(len(memory), wanted.record(owner, 0), tag, owner.key)
        plan_write(memory, data, tag, owner.key, owner.site)
    except (RecordRefused, ValueError) as error:
        return Judgement("kept", str(error))
    if wear(writes + 1, contents.layout.slots) > 1.0:
        return Judgement("kept", f"worn: written {writes} times, endures {ENDURED_WRITES} a slot")
    return Judgement("write", difference)


def _is_lost(record: TagRecord, wanted: Wanted) -> bool:
    """Whether what people measured would give way to what a map made of it: they alone decide."""
    return record.surveyed and not wanted.surveyed and not wanted.retired


def _difference(wanted: Wanted, record: TagRecord | None) -> str | None:
    if record is None:
        return None
    if record.retired and wanted.retired:
        return None
    if (record.retired, record.surveyed) != (wanted.retired, wanted.surveyed):
        return "other flags"
    off = [a - b for a, b in zip(record.p_m, wanted.p_m, strict=True)]
    off_m = math.hypot(*off)
    threshold_m = max(LEAST_DIFFERENCE_M, SIGMAS * _sigma_along(off, wanted.cov))
    if off_m <= threshold_m:
        return None
    return f"{off_m:.3f} m off, more than {threshold_m:.3f} m"


def _sigma_along(direction: list[float], cov: tuple[float, ...]) -> float:
    """Standard deviation in m in this direction, which need not have length 1."""
    x, y, z = direction
    xx, xy, xz, yy, yz, zz = cov
    square = x * x + y * y + z * z
    if square == 0.0:
        return 0.0
    variance = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z)
    return math.sqrt(max(variance, 0.0) / square)
