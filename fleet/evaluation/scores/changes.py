"""Tags that were moved, against when the map knew; and tags that it moved though nobody had."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fleet.evaluation.scores.evidence import Evidence
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.alignment import align

FOUND_M = 0.05
JUMP_M = 0.10
LEAST_SIGHTINGS = 5
"""A moved tag that was seen less often again nobody could have found."""
OF_PLACE = ("moved", "swapped")


@dataclass(frozen=True, slots=True)
class Changes:
    """after: sightings of each found one from its move until a version had it in its new place."""

    found: int
    missed: int
    after: tuple[int, ...]
    false_alarms: int


def judge_changes(evidence: Evidence, T_truth_of: Mapping[int, Array | None]) -> Changes:
    moves = _moves(evidence)
    found, missed, after = 0, 0, []
    for epc, at_ns in moves.items():
        seen_ns = _seen(evidence, epc, at_ns)
        if len(seen_ns) < LEAST_SIGHTINGS:
            continue
        known_ns = _known(evidence, epc, at_ns, T_truth_of)
        if known_ns is None:
            missed += 1
        else:
            found += 1
            after.append(sum(t_ns <= known_ns for t_ns in seen_ns))
    return Changes(found, missed, tuple(after), _false_alarms(evidence, set(moves)))


def _moves(evidence: Evidence) -> dict[str, int]:
    """EPC and time of the last move of each tag that has moved."""
    world, names = evidence.world, evidence.world.around.tags.names
    moves: dict[str, int] = {}
    for event in world.scenario.event:
        at_ns = world.start_ns + round(1e9 * event.at_s)
        if event.kind in OF_PLACE and at_ns < world.end_ns:
            before, now = world.around.tags.at(at_ns - 1), world.around.tags.at(at_ns + 1)
            moved = np.linalg.norm(now.p[: len(names)] - before.p[: len(names)], axis=-1) > 1e-6
            moves |= {names[k]: at_ns for k in np.flatnonzero(moved)}
    return moves


def _seen(evidence: Evidence, epc: str, from_ns: int) -> list[int]:
    return [
        t_ns
        for keyframe in evidence.keyframes
        if (t_ns := evidence.when(keyframe)) > from_ns
        and any(sighting.tag == epc for sighting in keyframe.sightings)
    ]


def _known(
    evidence: Evidence, epc: str, from_ns: int, T_truth_of: Mapping[int, Array | None]
) -> int | None:
    """When the first version after the move was made from which on the tag is in its new place."""
    since: int | None = None
    for version in sorted(evidence.versions, key=lambda one: one.version):
        T, tag = T_truth_of.get(version.version), _tag(evidence, version.version, epc)
        if version.t_ns < from_ns or T is None:
            continue
        is_there = False
        if tag is not None:
            p = T[:3, :3] @ tag + T[:3, 3]
            away_m = np.linalg.norm(evidence.places(epc, version.t_ns) - p, axis=-1)
            is_there = bool((away_m <= FOUND_M).any())
        since = (version.t_ns if since is None else since) if is_there else None
    return since


def _false_alarms(evidence: Evidence, moved: set[str]) -> int:
    """Jumps of tags that hang where they hung, from one version to the next laid onto it: how a map
    that hangs on nothing lies is no jump."""
    count = 0
    ordered = sorted(evidence.versions, key=lambda one: one.version)
    for before, after in pairwise(ordered):
        if before.gauge != after.gauge:
            continue
        old, new = _placed(evidence, before.version), _placed(evidence, after.version)
        shared = sorted(set(old) & set(new))
        p, q = (np.array([of[tag][0] for tag in shared]).reshape(-1, 3) for of in (old, new))
        hangs = np.array([tag not in moved for tag in shared], dtype=bool)
        laid = align(p[hangs], q[hangs])
        if hangs.sum() <= 3 or not laid.determined:
            continue
        shift = q - se3.act(laid.T_b_a, p)
        sigma_m = np.array([max(old[tag][1], new[tag][1]) for tag in shared])
        jumped = np.linalg.norm(shift, axis=-1) > np.maximum(JUMP_M, 5.0 * sigma_m)
        count += int((jumped & hangs).sum())
    return count


def _tag(evidence: Evidence, version: int, epc: str) -> Array | None:
    found = _placed(evidence, version).get(epc)
    return None if found is None else found[0]


def _placed(evidence: Evidence, version: int) -> dict[str, tuple[Array, float]]:
    return {
        tag.tag: (np.array(tag.p_m), float(np.sqrt(max(tag.cov[0], tag.cov[3], tag.cov[5]))))
        for tag in evidence.tags.get(version, [])
        if tag.p_m is not None and tag.cov is not None
    }
