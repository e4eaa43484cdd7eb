"""SQLite: the site database and the agent's outbox. The only room that knows about it."""

from tagmap.store.batch import Batch, Inserted, RefusalRow, Survey
from tagmap.store.outbox import Outbox, OutboxCounts, RefusedMessage
from tagmap.store.rows import Counts, PoseRow, RobotRow, SessionPoses, SessionRow
from tagmap.store.site import SiteStore

__all__ = [
    "Batch",
    "Counts",
    "Inserted",
    "Outbox",
    "OutboxCounts",
    "PoseRow",
    "RefusalRow",
    "RefusedMessage",
    "RobotRow",
    "SessionPoses",
    "SessionRow",
    "SiteStore",
    "Survey",
]
