"""Surveys in force: what operators told, and what the memories of tags say."""

import math

from tagmap.store.batch import MemorySurvey, Survey
from tagmap.store.blobs import unpack
from tagmap.store.connection import Connection

# A bare column beside max() is of the row that has it.
_TOLD = "SELECT tag, p_m, sigma_m, max(t_ns) FROM surveys GROUP BY tag"
_REMEMBERED = (
    "SELECT tag, p_m, cov, robots.name, t_ns, max(memory_surveys.id) FROM memory_surveys "
    "LEFT JOIN robots ON robots.id = robot_id GROUP BY tag ORDER BY tag"
)
_AXES = (0, 3, 5)


def read(db: Connection) -> list[Survey]:
    """One of each tag, in their order: an operator's wins, whenever it was told."""
    found = {one.tag: _survey(one) for one in read_memories(db)}
    for tag, p_m, sigma_m, t_ns in db.rows(_TOLD):
        found[tag] = Survey(tag, unpack(p_m), sigma_m, t_ns)
    return [found[tag] for tag in sorted(found)]


def read_memories(db: Connection) -> list[MemorySurvey]:
    """Of the tags whose memory still says so, in their order."""
    return [
        MemorySurvey(tag, unpack(p_m), unpack(cov), robot, t_ns)
        for tag, p_m, cov, robot, t_ns, _ in db.rows(_REMEMBERED)
        if p_m is not None
    ]


def _survey(one: MemorySurvey) -> Survey:
    assert one.p_m is not None
    assert one.cov is not None
    sigma_m = math.sqrt(max(one.cov[i] for i in _AXES))
    return Survey(one.tag, one.p_m, sigma_m, one.t_ns, one.cov, one.robot)
