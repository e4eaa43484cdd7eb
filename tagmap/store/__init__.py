"""SQLite: the site database and the agent's outbox. The only room that knows about it."""

from tagmap.store.archive import Keep
from tagmap.store.batch import Batch, Inserted, MemorySurvey, Reading, RefusalRow, Survey
from tagmap.store.outbox import Outbox, OutboxCounts, RefusedMessage
from tagmap.store.rows import (
    Condensed,
    Counts,
    MemoryRow,
    PoseRow,
    RobotRow,
    SessionPoses,
    SessionRow,
    Step,
)
from tagmap.store.site import SiteStore

__all__ = [
    "Batch",
    "Condensed",
    "Counts",
    "Inserted",
    "Keep",
    "MemoryRow",
    "MemorySurvey",
    "Outbox",
    "OutboxCounts",
    "PoseRow",
    "Reading",
    "RefusalRow",
    "RefusedMessage",
    "RobotRow",
    "SessionPoses",
    "SessionRow",
    "SiteStore",
    "Step",
    "Survey",
]
