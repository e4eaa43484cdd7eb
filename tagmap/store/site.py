"""The site database: facts from robots, and the maps derived from them."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Self

from tagmap.errors import RecordRefused, StoreError
from tagmap.records import Hello, Keyframe, MapVersion, Tag, decode
from tagmap.store import archive, condensed, keyframes, maps, surveys
from tagmap.store.archive import Keep
from tagmap.store.batch import Batch, Inserted, RefusalRow, Survey
from tagmap.store.connection import Connection
from tagmap.store.ingest import insert_batch
from tagmap.store.migrations import SITE, open_for_reading, open_for_writing
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

_ROBOTS = """
    SELECT name, number, count(sessions.id),
        coalesce(sum(keyframes), 0),
        coalesce(sum(sightings), 0),
        coalesce(sum((SELECT count(*) FROM refusals WHERE session_id = sessions.id)), 0),
        max((SELECT t_ns FROM keyframes WHERE session_id = sessions.id ORDER BY seq DESC LIMIT 1))
    FROM robots LEFT JOIN sessions ON robot_id = robots.id GROUP BY robots.id ORDER BY name"""


class SiteStore:
    """One process writes, any number read at the same time; each instance belongs to one thread.

    Whatever goes wrong is a StoreError of one line that names the file; what was being written is
    then not stored at all, and the store remains usable.
    """

    def __init__(self, connection: Connection, site: str) -> None:
        self._db = connection
        self.site = site

    @classmethod
    def open(cls, path: Path, site: str | None = None, read_only: bool = False) -> Self:
        """Open the database of `site`, or of whatever site it is when None.

        For writing, a database that is not there is created (`site` then says whose) and an older
        one is migrated.
        """
        if read_only:
            db = open_for_reading(path, SITE)
        else:
            db = open_for_writing(path, SITE, create=site is not None)
        try:
            if site is not None and not read_only:
                db.execute("INSERT INTO site VALUES (1, ?) ON CONFLICT DO NOTHING", [site])
            return cls(db, _site_of(db, site))
        except BaseException:
            db.close()
            raise

    def close(self) -> None:
        self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def path(self) -> Path:
        return self._db.path

    def commit(self, batch: Batch) -> Inserted:
        """Store the batch in one transaction and say how much of it was new.

        On the disk when this returns. What is known already by (robot, session, seq) is skipped.
        """
        with self._db.transaction():
            return insert_batch(self._db, batch)

    def commit_version(
        self,
        version: MapVersion,
        tags: Iterable[Tag],
        poses: Iterable[SessionPoses],
        summary: dict[str, Any],
        step: Step | None = None,
    ) -> None:
        """Store the next map version, and `poses` in place of those of the version before, or of
        those of them that were alive: see `Step`."""
        with self._db.transaction():
            maps.insert_version(self._db, version, tags, poses, summary, step or Step())

    def condensed(self) -> Condensed | None:
        """What the newest version was condensed into, if anything."""
        return condensed.read(self._db)

    def condensed_serial(self) -> int | None:
        return condensed.read_serial(self._db)

    def alive_poses(self) -> list[SessionPoses]:
        """Poses that the next version may move, one entry per session."""
        return maps.read_alive(self._db)

    def robots(self) -> list[RobotRow]:
        rows = self._db.rows(_ROBOTS)
        return [RobotRow(*row) for row in rows]

    def sessions(self) -> list[SessionRow]:
        """In the order in which they were first heard of."""
        rows = self._db.rows(
            "SELECT robots.name, number, session, hello, reason FROM sessions "
            "JOIN robots ON robots.id = sessions.robot_id "
            "LEFT JOIN refusals ON session_id = sessions.id AND seq = 0 ORDER BY sessions.id"
        )
        return [
            SessionRow(robot, number, session, self._hello(robot, session, hello), refused)
            for robot, number, session, hello, refused in rows
        ]

    def settled(self, robot: str, session: str) -> list[int]:
        """Seqs that are stored or refused, sorted; 0 is the hello."""
        rows = self._db.rows(
            "WITH one AS (SELECT sessions.id, hello FROM sessions "
            "JOIN robots ON robots.id = robot_id WHERE robots.name = ? AND session = ?) "
            "SELECT 0 FROM one WHERE hello IS NOT NULL "
            "UNION SELECT seq FROM keyframes WHERE session_id = (SELECT id FROM one) "
            "UNION SELECT seq FROM refusals WHERE session_id = (SELECT id FROM one) "
            "ORDER BY 1",
            [robot, session],
        )
        return [seq for (seq,) in rows]

    def refusals(
        self, robot: str | None = None, session: str | None = None, limit: int = 1000
    ) -> list[RefusalRow]:
        """Newest first."""
        rows = self._db.rows(
            "SELECT robots.name, session, seq, reason, t_ns FROM refusals "
            "JOIN sessions ON sessions.id = session_id JOIN robots ON robots.id = robot_id "
            "WHERE robots.name = coalesce(?1, robots.name) AND (?2 IS NULL OR session = ?2) "
            "ORDER BY refusals.id DESC LIMIT ?3",
            [robot, session, limit],
        )
        return [RefusalRow(*row) for row in rows]

    def keyframes(self, after_id: int = 0) -> Iterator[tuple[int, Keyframe]]:
        """Row ids and keyframes in the order in which they were stored, from `after_id` on."""
        return keyframes.read_all(self._db, self.site, after_id)

    def uncovered(self, after_id: int = 0) -> Iterator[tuple[int, Keyframe]]:
        """The same without those that are condensed."""
        return keyframes.read_uncovered(self._db, self.site, after_id)

    def archive(self, keep: Keep) -> int:
        """Let go of the oldest of what is too much, a little at a time; 0 when there is no more."""
        return archive.archive(self._db, keep)

    def archived(self, robot: str, session: str) -> list[tuple[int, int]]:
        """(first, last) of runs of its seqs that have left, and count as stored."""
        row = self._db.row(
            "SELECT sessions.id FROM sessions JOIN robots ON robots.id = robot_id "
            "WHERE robots.name = ? AND session = ?",
            [robot, session],
        )
        return [] if row is None else archive.runs_of(self._db, row[0])

    def has_archived(self) -> bool:
        return self._db.row("SELECT 1 FROM archived LIMIT 1") is not None

    def newest_id(self) -> int:
        """Row id of the last keyframe, 0 for none."""
        return int(self._db.scalar("SELECT coalesce(max(id), 0) FROM keyframes"))

    def keyframes_of(self, robot: str, session: str, from_seq: int = 1) -> list[Keyframe]:
        """A session's keyframes in the order of seq."""
        return list(keyframes.read_session(self._db, self.site, robot, session, from_seq))

    def surveys(self) -> list[Survey]:
        """Those in force, in the order of tag ids: what an operator told last, else what the tag's
        own memory says."""
        return surveys.read(self._db)

    def memory_surveys(self) -> list[Survey]:
        """What the memories say of all tags, also of those that operators surveyed."""
        return surveys.read_memories(self._db)

    def readings(self) -> Iterator[tuple[str, bytes, str]]:
        """Tag, memory and robot of every memory that was ever read, as it was stored."""
        rows = self._db.rows(
            "SELECT tag, memory, robots.name FROM memory_readings "
            "JOIN robots ON robots.id = robot_id WHERE memory IS NOT NULL "
            "ORDER BY memory_readings.id"
        )
        yield from rows

    def memories(self) -> list[MemoryRow]:
        """Of each tag whose memory was ever read, in the order of tag ids.

        A bare column beside max() is of the row that has it.
        """
        rows = self._db.rows(
            "SELECT tag, memory, coalesce(writes, 0), max(id) FROM memory_readings LEFT JOIN "
            "(SELECT tag, count(DISTINCT job) AS writes FROM memory_readings "
            "WHERE outcome = 'written' GROUP BY tag) USING (tag) "
            "WHERE memory IS NOT NULL GROUP BY tag ORDER BY tag"
        )
        return [MemoryRow(tag, memory, writes) for tag, memory, writes, _ in rows]

    def latest_version(self) -> MapVersion | None:
        return maps.read_latest(self._db)

    def versions(self) -> list[MapVersion]:
        """Oldest first."""
        return maps.read_versions(self._db)

    def summary(self, version: int) -> dict[str, Any] | None:
        """What `commit_version` was given; None for an unknown version."""
        return maps.read_summary(self._db, version)

    def tags(self, version: int | None = None) -> list[Tag]:
        """Of the newest version unless told otherwise; none for an unknown one."""
        if version is None:
            latest = self.latest_version()
            return [] if latest is None else maps.read_tags(self._db, latest.version)
        return maps.read_tags(self._db, version)

    def poses(self) -> list[SessionPoses]:
        """All poses of the newest version, one entry per session, in time order."""
        return maps.read_poses(self._db)

    def trajectory(self, robot: str) -> Iterator[PoseRow]:
        """A robot's poses in the newest version, in time order."""
        return maps.read_trajectory(self._db, robot)

    def pose_bracket(self, robot: str, t_ns: int) -> tuple[PoseRow, PoseRow] | None:
        """The poses of one session at or before and at or after `t_ns`; the same one on a hit.

        None where no session spans that time.
        """
        return maps.read_bracket(self._db, robot, t_ns)

    def counts(self) -> Counts:
        row = self._db.rows(
            "SELECT (SELECT count(*) FROM robots), count(*), coalesce(sum(keyframes), 0), "
            "coalesce(sum(sightings), 0), (SELECT count(*) FROM refusals), "
            "(SELECT count(*) FROM tag_estimates "
            "WHERE version = (SELECT max(version) FROM map_versions)), "
            "(SELECT count(*) FROM map_versions), "
            "(SELECT coalesce(sum(last_seq - first_seq + 1), 0) FROM covered), "
            "coalesce(sum(archived), 0) FROM sessions"
        )[0]
        return Counts(*row)

    def _hello(self, robot: str, session: str, payload: bytes | None) -> Hello | None:
        try:
            return None if payload is None else decode(Hello, payload)
        except RecordRefused as error:
            raise StoreError(f"{self.path}: hello of {robot} {session}: {error}") from error


def _site_of(db: Connection, wanted: str | None) -> str:
    row = db.row("SELECT name FROM site")
    if row is None:
        raise StoreError(f"{db.path}: names no site")
    if wanted is not None and row[0] != wanted:
        raise StoreError(f"{db.path}: belongs to site {row[0]!r}, not {wanted!r}")
    return str(row[0])
