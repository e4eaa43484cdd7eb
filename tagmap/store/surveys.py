"""Surveys in force: what operators told, and what the memories of tags say."""

import math

from tagmap.store.batch import Survey
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
    found = {survey.tag: survey for survey in read_memories(db)}
    for tag, p_m, sigma_m, t_ns in db.rows(_TOLD):
        found[tag] = Survey(tag, unpack(p_m), sigma_m, t_ns)
    return [found[tag] for tag in sorted(found)]


def read_memories(db: Connection) -> list[Survey]:
    """Of the tags whose memory still says so, in their order."""
    rows = db.rows(_REMEMBERED)
    return [_survey(*row) for *row, _ in rows if row[1] is not None]


def _survey(tag: str, p_m: bytes, cov: bytes, robot: str, t_ns: int) -> Survey:
    upper = unpack(cov)
    sigma_m = math.sqrt(max(upper[i] for i in _AXES))
    return Survey(tag, unpack(p_m), sigma_m, t_ns, upper, robot)
