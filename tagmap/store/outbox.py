"""An agent's messages, kept until the service has settled them; survives kill -9 and reboot.

Nothing here looks into a payload. A session's messages are numbered 0 (hello), 1, 2, ... without
gaps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from tagmap.errors import StoreError
from tagmap.store.connection import Connection, Row
from tagmap.store.migrations import OUTBOX, open_for_writing


@dataclass(frozen=True, slots=True)
class OutboxCounts:
    """Messages, hellos included: appended = settled + pending. Refused ones are settled too."""

    sessions: int
    appended: int
    settled: int
    refused: int
    pending: int
    refused_hellos: int
    pending_hellos: int

    @property
    def keyframes(self) -> int:
        """Appended messages that are no hellos."""
        return self.appended - self.sessions


@dataclass(frozen=True, slots=True)
class RefusedMessage:
    session: str
    seq: int
    reason: str
    payload: bytes | None


class Outbox:
    """Belongs to one agent, and to one thread of it; a second process is refused."""

    def __init__(self, connection: Connection) -> None:
        self._db = connection
        self._source = ""

    @classmethod
    def open(cls, path: Path, owner: str | None = None) -> Self:
        """Created when it is not there. StoreError names the file.

        The first `owner` named is kept; another one is refused.
        """
        db = open_for_writing(path, OUTBOX, create=True)
        try:
            if owner is not None:
                _claim(db, owner)
        except BaseException:
            db.close()
            raise
        return cls(db)

    def close(self) -> None:
        self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start_session(self, session: str, hello_payload: bytes) -> None:
        """StoreError when there was a session of that name before."""
        with self._db.transaction():
            if self._find(session) is not None:
                raise StoreError(f"{self._db.path}: session {session} was started before")
            self._db.execute("INSERT INTO sessions (session, last_seq) VALUES (?, 0)", [session])
            self._insert(self._id(session), [(0, hello_payload)])

    def append(self, session: str, items: Sequence[tuple[int, bytes]], cursor: int) -> None:
        """Keep (seq, payload) items and, in the same transaction, where the source now is.

        StoreError unless the seqs go on where the session ends.
        """
        with self._db.transaction():
            session_id = self._id(session)
            query = "SELECT last_seq FROM sessions WHERE id = ?"
            last_seq = self._db.scalar(query, [session_id])
            seqs = [seq for seq, _ in items]
            if seqs != list(range(last_seq + 1, last_seq + 1 + len(seqs))):
                raise StoreError(
                    f"{self._db.path}: session {session} ends at seq {last_seq}, got {seqs[:3]}..."
                )
            self._insert(session_id, items)
            update = "UPDATE sessions SET last_seq = ? WHERE id = ?"
            self._db.execute(update, [last_seq + len(seqs), session_id])
            self._db.execute("REPLACE INTO sources VALUES (?, ?)", [self._source, cursor])

    def resume(self, source: str) -> int:
        """Append from `source` from now on; its cursor."""
        self._source = source
        return self.cursor()

    def cursor(self) -> int:
        """Where the source was at its last append; 0 before the first."""
        row = self._db.row("SELECT cursor FROM sources WHERE name = ?", [self._source])
        return 0 if row is None else int(row[0])

    def unsettled(
        self, limit: int, after: tuple[str, int] | None = None
    ) -> list[tuple[str, int, bytes]]:
        """The oldest (session, seq, payload), from behind `after` = (session, seq) on."""
        session, seq = after if after is not None else (None, -1)
        return self._db.rows(
            "SELECT session, seq, payload FROM unsettled JOIN sessions ON sessions.id = session_id "
            "WHERE (session_id, seq) > (?, ?) ORDER BY session_id, seq LIMIT ?",
            [0 if session is None else self._id(session), seq, limit],
        )

    def settle(self, session: str, contiguous: int, refused: Sequence[tuple[int, str]] = ()) -> int:
        """Drop what is settled: all up to `contiguous`, and the refused (seq, reason), which are
        kept apart. The number of messages that were pending until now; an unknown session has none.

        A refusal may be told late, or again.
        """
        session_id = self._find(session)
        if session_id is None:
            return 0
        with self._db.transaction():
            self._db.executemany(
                "INSERT OR IGNORE INTO refused SELECT id, ?1, ?2, "
                "(SELECT payload FROM unsettled WHERE session_id = id AND seq = ?1) "
                "FROM sessions WHERE id = ?3 AND last_seq >= ?1",
                [(seq, reason, session_id) for seq, reason in refused],
            )
            dropped = self._db.executemany(
                "DELETE FROM unsettled WHERE session_id = ? AND seq = ?",
                [(session_id, seq) for seq, _ in refused],
            )
            delete = "DELETE FROM unsettled WHERE session_id = ? AND seq <= ?"
            return dropped + self._db.execute(delete, [session_id, contiguous])

    def pending_sessions(self) -> list[str]:
        """Sessions with unsettled messages, oldest first."""
        rows = self._db.rows(
            "SELECT session FROM sessions "
            "WHERE EXISTS (SELECT 1 FROM unsettled WHERE session_id = sessions.id) ORDER BY id"
        )
        return [session for (session,) in rows]

    def refused(self) -> list[RefusedMessage]:
        """Oldest first."""
        rows = self._db.rows(
            "SELECT session, seq, reason, payload FROM refused "
            "JOIN sessions ON sessions.id = session_id ORDER BY session_id, seq"
        )
        return [RefusedMessage(*row) for row in rows]

    def counts(self) -> OutboxCounts:
        sessions, appended = self._db.rows(
            "SELECT count(*), coalesce(sum(last_seq + 1), 0) FROM sessions"
        )[0]
        refused, refused_hellos = self._count("refused")
        pending, pending_hellos = self._count("unsettled")
        settled = appended - pending
        return OutboxCounts(
            sessions, appended, settled, refused, pending, refused_hellos, pending_hellos
        )

    def _count(self, table: str) -> Row:
        """All messages, and the hellos among them."""
        query = f"SELECT count(*), count(*) FILTER (WHERE seq = 0) FROM {table}"
        return self._db.rows(query)[0]

    def _find(self, session: str) -> int | None:
        row = self._db.row("SELECT id FROM sessions WHERE session = ?", [session])
        return None if row is None else int(row[0])

    def _id(self, session: str) -> int:
        found = self._find(session)
        if found is None:
            raise StoreError(f"{self._db.path}: no session {session}")
        return found

    def _insert(self, session_id: int, items: Sequence[tuple[int, bytes]]) -> None:
        rows = [(session_id, seq, payload) for seq, payload in items]
        self._db.executemany("INSERT INTO unsettled VALUES (?, ?, ?)", rows)


def _claim(db: Connection, owner: str) -> None:
    with db.transaction():
        db.execute("INSERT OR IGNORE INTO owner VALUES (1, ?)", [owner])
        found = db.scalar("SELECT name FROM owner")
    if found != owner:
        raise StoreError(f"{db.path}: the outbox of {found}, not of {owner}")
