"""What old keyframes were condensed into, as the solver wrote it, and which keyframes these are."""

from tagmap.store.connection import Connection
from tagmap.store.rows import Condensed

_COVERED = """
    SELECT robots.name, sessions.session, first_seq, last_seq FROM covered
    JOIN sessions ON sessions.id = session_id JOIN robots ON robots.id = robot_id
    ORDER BY session_id, first_seq"""
_COVER = """
    INSERT INTO covered SELECT sessions.id, ?3, ?4 FROM sessions
    JOIN robots ON robots.id = robot_id WHERE robots.name = ?1 AND session = ?2"""


def replace(db: Connection, version: int, condensed: Condensed | None) -> None:
    """To be called inside the transaction of a map version."""
    db.execute("DELETE FROM covered")
    db.execute("DELETE FROM condensed")
    if condensed is not None:
        values = [1, condensed.serial, version, condensed.content]
        db.execute("INSERT INTO condensed VALUES (?, ?, ?, ?)", values)
        db.executemany(_COVER, condensed.covered)


def read(db: Connection) -> Condensed | None:
    """Of one moment, whatever is written meanwhile."""
    with db.snapshot():
        row = db.row("SELECT serial, content FROM condensed")
        return None if row is None else Condensed(row[0], row[1], tuple(db.rows(_COVERED)))


def read_serial(db: Connection) -> int | None:
    row = db.row("SELECT serial FROM condensed")
    return None if row is None else int(row[0])
