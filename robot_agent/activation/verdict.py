"""What a shot came to, and the sighting that follows from it."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from robot_agent.activation.target import Target
from tagmap.conventions import Array
from tagmap.records.job import JobResult
from tagmap.records.keyframe import MAX_MEMORY_BYTES, Sighting

Kind: TypeAlias = Literal[
    "identified", "false_match", "out_of_range", "ambiguous", "timeout", "refused"
]
"""identified    one tag, and it is the target
false_match   nothing there answers: match the spots anew without this pair
out_of_range  nothing answers, but from so far away that says nothing
ambiguous     more than one tag may be the one: no identity
timeout       the permit ended, or a device failed, before it was clear
refused       the target cannot be shot at: unreachable, or outside the sector
"""


@dataclass(frozen=True, slots=True)
class Verdict:
    """
    tag       of an identified one, with its `memory` where that was read
    p_false   that it is another; 1 without a tag
    reason    one line for people
    theta     (2,) mirror angles that lit it, None: nothing did
    shots     windows of light
    result    of the write job that was carried out
    depth     whether the light also proves how far away it is, that is the match of the two spots
    """

    kind: Kind
    reason: str
    shots: int = 0
    tag: str | None = None
    p_false: float = 1.0
    theta: Array | None = None
    memory: bytes | None = None
    result: JobResult | None = None
    depth: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """One target's verdict; `lease` under which it was shot, None: alone, in a blink code."""

    target: Target
    verdict: Verdict
    lease: int | None
    began_ns: int
    ended_ns: int

    def sighting(self) -> Sighting | None:
        """What goes into the keyframe of the exposure that showed the spot; None: no identity.

        The laser is beside the left camera, so what it lights is the left spot's tag.
        """
        verdict = self.verdict
        if verdict.kind != "identified" or verdict.tag is None:
            return None
        memory = verdict.memory
        return Sighting(
            tag=verdict.tag,
            id_by="laser",
            p_false=verdict.p_false,
            lease=self.lease,
            z=self.target.z if verdict.depth else self.target.left,
            memory=None if memory is None else memory[:MAX_MEMORY_BYTES],
        )


def distance_m(target: Target) -> float:
    return float(np.linalg.norm(target.p_cam))
