"""What may leave the database so that it does not grow for ever, in small transactions.

Keyframes that are condensed in a committed version, oldest first, and poses of theirs; tags and
summaries of old versions. That they were there stays known: nothing is taken twice.
Pages that become free are used again by SQLite: the file stays as large as it once had to be.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from tagmap.records.spans import spans_of, united
from tagmap.store.connection import Connection, Row

AT_ONCE = 200

_OLDEST = """
    SELECT id, session_id, seq, (SELECT count(*) FROM sightings WHERE keyframe_id = keyframes.id)
    FROM keyframes WHERE id < (SELECT max(id) FROM keyframes) AND EXISTS (
        SELECT 1 FROM covered WHERE covered.session_id = keyframes.session_id
        AND first_seq <= keyframes.seq AND keyframes.seq <= last_seq)
    ORDER BY id LIMIT ?"""
_TALLY = (
    "UPDATE sessions SET archived = archived + ?, archived_sightings = archived_sightings + ? "
    "WHERE id = ?"
)
_POSES = (
    "DELETE FROM keyframe_poses WHERE session_id = ?1 AND NOT alive AND last_t_ns < "
    "coalesce((SELECT min(t_ns) FROM keyframes WHERE session_id = ?1), 9223372036854775807)"
)


@dataclass(frozen=True, slots=True)
class Keep:
    """How many there may be; None: all of them, for ever. versions: with their tags, at least 1."""

    keyframes: int | None = None
    versions: int | None = None


def archive(db: Connection, keep: Keep) -> int:
    """The oldest of what is too much, AT_ONCE keyframes and a version at most; how many went."""
    with db.transaction():
        thinned = _thin_versions(db, keep.versions)
        if keep.keyframes is None:
            return thinned
        stored = "SELECT coalesce(sum(keyframes - archived), 0) FROM sessions"
        excess = int(db.scalar(stored)) - keep.keyframes
        rows = db.rows(_OLDEST, [max(0, min(excess, AT_ONCE))])
        if rows:
            _remove(db, rows)
    return len(rows) + thinned


def runs_of(db: Connection, session_id: int) -> list[tuple[int, int]]:
    """(first, last) seqs of the session that left."""
    query = "SELECT first_seq, last_seq FROM archived WHERE session_id = ? ORDER BY first_seq"
    return db.rows(query, [session_id])


def _remove(db: Connection, rows: Sequence[Row]) -> None:
    ids = [(row[0],) for row in rows]
    seqs: dict[int, list[int]] = defaultdict(list)
    sightings: dict[int, int] = defaultdict(int)
    for _, session_id, seq, seen in rows:
        seqs[session_id].append(seq)
        sightings[session_id] += seen
    db.executemany("DELETE FROM sightings WHERE keyframe_id = ?", ids)
    db.executemany("DELETE FROM keyframes WHERE id = ?", ids)
    for session_id, gone in seqs.items():
        db.execute(_TALLY, [len(gone), sightings[session_id], session_id])
        db.execute(_POSES, [session_id])
        runs = united(tuple(runs_of(db, session_id)), spans_of(gone))
        db.execute("DELETE FROM archived WHERE session_id = ?", [session_id])
        values = [(session_id, *run) for run in runs]
        db.executemany("INSERT INTO archived VALUES (?, ?, ?)", values)


def _thin_versions(db: Connection, keep: int | None) -> int:
    """The oldest version that still has tags, if it is one too many; 1 if so."""
    if keep is None:
        return 0
    oldest = db.scalar("SELECT min(version) FROM tag_estimates")
    newest = db.scalar("SELECT max(version) FROM map_versions")
    if oldest is None or oldest > newest - max(keep, 1):
        return 0
    db.execute("DELETE FROM tag_estimates WHERE version = ?", [oldest])
    db.execute("UPDATE map_versions SET summary = '{}' WHERE version = ?", [oldest])
    return 1
