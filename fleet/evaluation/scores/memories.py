"""What tags remember at the end, against the map."""

from dataclasses import dataclass

import numpy as np

from fleet.evaluation.scores.evidence import Evidence
from tagmap.errors import RecordRefused
from tagmap.memory.slots import read
from tagmap.records import Tag

LEAST_M, SIGMAS = 0.010, 2.0


@dataclass(frozen=True, slots=True)
class Memories:
    """right: the record that counts is where the map has the tag; stale: it is elsewhere; torn: a
    slot holds neither a record nor nothing."""

    right: int
    stale: int
    torn: int


def judge_memories(evidence: Evidence, site_number: int) -> Memories:
    latest = evidence.latest
    tags = {tag.tag: tag for tag in evidence.tags.get(latest.version, [])} if latest else {}
    right = stale = torn = 0
    for tag in evidence.world.scene.tags:
        memory = b"".join(word.to_bytes(2, "big") for word in tag.memory.words)
        try:
            contents = read(memory, tag.epc, None, site_number)
        except RecordRefused:
            continue
        torn += any(isinstance(slot, str) and slot != "blank" for slot in contents.slots)
        if contents.record is not None:
            is_right = _agrees(contents.record.p_m, tags.get(tag.epc))
            right += is_right
            stale += not is_right
    return Memories(right, stale, torn)


def _agrees(p_m: tuple[float, float, float], tag: Tag | None) -> bool:
    """Within what is not worth a write."""
    if tag is None or tag.p_m is None or tag.cov is None:
        return False
    sigma_m = float(np.sqrt(max(tag.cov[0], tag.cov[3], tag.cov[5])))
    away_m = float(np.linalg.norm(np.array(p_m) - np.array(tag.p_m)))
    return away_m <= max(LEAST_M, SIGMAS * sigma_m)
