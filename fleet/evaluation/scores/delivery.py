"""What was sent, stored and acknowledged, and how soon."""

from dataclasses import dataclass

import numpy as np

from fleet.evaluation.scores.evidence import Evidence
from tagmap.conventions import Array
from tagmap.errors import RecordRefused
from tagmap.records import Ack, decode
from tagmap.records.codec import address_of


@dataclass(frozen=True, slots=True)
class Delivery:
    """lost: acknowledged keyframes that are neither stored nor refused. ack_ms (N,): from the first
    time that a keyframe was put until one settled it."""

    stored: int
    duplicated: int
    lost: int
    ack_ms: Array


def judge_delivery(evidence: Evidence) -> Delivery:
    numbered = {(k.robot, k.session, k.seq) for k in evidence.keyframes}
    moments = {(k.robot, k.session, k.t_ns) for k in evidence.keyframes}
    stored = len(evidence.keyframes)
    lost = _acknowledged(evidence) - {(s, seq) for _, s, seq in numbered} - _refused(evidence)
    duplicated = stored - min(len(numbered), len(moments))
    return Delivery(stored, duplicated, len(lost), _ack_ms(evidence))


def _acknowledged(evidence: Evidence) -> set[tuple[str, int]]:
    """Session and number of every keyframe that the service said it had."""
    reached: dict[str, int] = {}
    keys = evidence.keys
    for heard in evidence.heard:
        robot = keys.robot_of(heard.key)
        if robot is not None and heard.key == keys.ack(robot):
            ack = _ack(heard.payload)
            if ack is not None:
                reached[ack.session] = max(ack.contiguous, reached.get(ack.session, 0))
    return {(session, seq) for session, last in reached.items() for seq in range(1, last + 1)}


def _refused(evidence: Evidence) -> set[tuple[str, int]]:
    with evidence.store() as store:
        return {
            (row.session, refusal.seq)
            for row in store.sessions()
            for refusal in store.refusals(row.robot, row.session)
            if refusal.seq is not None
        }


def _ack_ms(evidence: Evidence) -> Array:
    put: dict[str, dict[int, int]] = {}
    taken: list[float] = []
    keys = evidence.keys
    for heard in evidence.heard:
        robot = keys.robot_of(heard.key)
        if robot is None:
            continue
        if heard.key == keys.keyframes(robot):
            address = address_of(heard.payload)
            if address is not None and address.seq > 0:
                put.setdefault(address.session, {}).setdefault(address.seq, heard.t_ns)
        elif heard.key == keys.ack(robot):
            taken += _settled(put, heard.payload, heard.t_ns)
    return np.array(taken)


def _settled(put: dict[str, dict[int, int]], payload: bytes, t_ns: int) -> list[float]:
    ack = _ack(payload)
    if ack is None:
        return []
    waiting = put.get(ack.session, {})
    done = [seq for seq in waiting if 0 <= seq <= ack.contiguous and waiting[seq] >= 0]
    found = [1e-6 * (t_ns - waiting[seq]) for seq in done]
    waiting.update(dict.fromkeys(done, -1))
    return found


def _ack(payload: bytes) -> Ack | None:
    try:
        return decode(Ack, payload)
    except RecordRefused:
        return None
