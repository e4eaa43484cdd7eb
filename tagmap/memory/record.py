"""The record in a tag's memory: where the tag is, how well that is known, and who says so."""

import math
import re
from functools import lru_cache

from tagmap.records.base import Record

VERSION = 1
EPC = re.compile(r"(?:[0-9a-f]{4})+")

_HAS_COVARIANCE, _SURVEYED, _FROZEN, _RETIRED = 8, 4, 2, 1


class TagRecord(Record, frozen=True, kw_only=True):
    """One tag as one map version had it.

    map_version  the compact form keeps the low 16 bits
    p_m          x, y, z in map; a planar site has z = 0
    cov          upper triangle of its 3x3 in m^2, or None; the compact form keeps one sigma
    surveyed     the position is a survey's, as people measured it, not what a map made of it
    frozen       not to be overwritten by a service
    retired      the tag is no longer to be localised by
    site, robot  numbers of the site and of the robot that wrote it; None in the compact form
    t_s          unix time of the map version in s; None in the compact form
    count        sightings that carry the position, 65535 for more; None in the compact form
    """

    map_version: int
    p_m: tuple[float, float, float]
    cov: tuple[float, ...] | None = None
    surveyed: bool = False
    frozen: bool = False
    retired: bool = False
    site: int | None = None
    t_s: int | None = None
    robot: int | None = None
    count: int | None = None


@lru_cache(maxsize=65536)
def tag_bytes(tag: str) -> bytes:
    """What seeds the checksums: an EPC's bytes (whole 16-bit words in hex), else the name's."""
    return bytes.fromhex(tag) if EPC.fullmatch(tag) else tag.encode()


def head_of(record: TagRecord) -> int:
    """Version in the high nibble, flags in the low one."""
    return (
        VERSION << 4
        | (_HAS_COVARIANCE if record.cov is not None else 0)
        | (_SURVEYED if record.surveyed else 0)
        | (_FROZEN if record.frozen else 0)
        | (_RETIRED if record.retired else 0)
    )


def flags_of(head: int) -> tuple[bool, bool, bool, bool]:
    """has covariance, surveyed, frozen, retired"""
    return (
        bool(head & _HAS_COVARIANCE),
        bool(head & _SURVEYED),
        bool(head & _FROZEN),
        bool(head & _RETIRED),
    )


def steps(p_m: tuple[float, float, float], step_m: float, most: int) -> tuple[int, int, int]:
    """Coordinates in whole steps. ValueError where one is more than `most`, or not a number."""
    per_m = round(1.0 / step_m)
    for value in p_m:
        if not abs(value) * per_m <= most:
            raise ValueError(f"p_m holds {value}, expected at most {most * step_m:g} m")
    x, y, z = p_m
    return round(x * per_m), round(y * per_m), round(z * per_m)


def is_finite(values: tuple[float, ...]) -> bool:
    return math.isfinite(sum(values))
