"""What a map may learn from what it reads in a tag: data incest is kept out here.

A position that a map wrote and a robot reads back is no new measurement: fused as one, the
covariance would shrink with every reading. Only what people surveyed is a prior, and only where the
site does not hold that survey already; everything else is a check.
"""

import math

from tagmap.memory.record import TagRecord


def is_prior(record: TagRecord) -> bool:
    """Whether the position may enter a map as a measurement of its own."""
    return record.surveyed and not record.retired and record.cov is not None


def distance_m(record: TagRecord, p_m: tuple[float, ...]) -> float:
    """How far the record is from where a map has the tag: in the plane where `p_m` is planar."""
    return math.dist(record.p_m[: len(p_m)], p_m)
