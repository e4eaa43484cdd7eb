"""What a map may learn from what it reads in a tag: data incest is kept out here.

A position that a map wrote and a robot reads back is no new measurement: fused as one, the
covariance would shrink with every reading. Only what people surveyed is a prior, and only where the
site does not hold that survey already; everything else is a check.
"""

import math

from tagmap.memory.record import TagRecord
from tagmap.records.base import check_covariance

# Better than a micrometre is not measured, and what is not known to 10 m was not surveyed.
LEAST_SIGMA_M = 1e-6
MOST_SIGMA_M = 10.0


def is_prior(record: TagRecord) -> bool:
    """Whether the position may enter a map as a measurement of its own."""
    return is_survey(record) and objection(record) is None


def is_survey(record: TagRecord) -> bool:
    """Whether it says that people measured the position, and that the tag is in use."""
    return record.surveyed and not record.retired


def objection(record: TagRecord) -> str | None:
    """Why the position of a survey cannot be used all the same."""
    if record.cov is None:
        return "surveyed, but without a covariance"
    try:
        check_covariance("covariance", record.cov, 3)
    except ValueError:
        return "surveyed, but its covariance is singular or none"
    for variance in (record.cov[0], record.cov[3], record.cov[5]):
        sigma_m = math.sqrt(variance)
        if not LEAST_SIGMA_M <= sigma_m <= MOST_SIGMA_M:
            expected = f"{LEAST_SIGMA_M:g} to {MOST_SIGMA_M:g}"
            return f"surveyed, but its sigma is {sigma_m:.3g} m, expected {expected}"
    return None


def distance_m(record: TagRecord, p_m: tuple[float, ...]) -> float:
    """How far the record is from where a map has the tag: in the plane where `p_m` is planar."""
    return math.dist(record.p_m[: len(p_m)], p_m)
