"""The schemas, as ordered lists of migrations; each is applied atomically with its record.

A released migration is never changed: what comes next is appended. sqlite-utils keeps the record.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from tagmap.errors import StoreError
from tagmap.store.connection import Connection, become_writer, connect, naming

if TYPE_CHECKING:
    from sqlite_utils import Database

Migration: TypeAlias = "Callable[[Database], None]"

RECORD = "_sqlite_migrations"


@dataclass(frozen=True, slots=True)
class Schema:
    """A kind of database file: what it is called, how it is recognised, how it came to be.

    `application_id` is in the file's header. The name of a migration function is its record.
    """

    name: str
    application_id: int
    migrations: tuple[Migration, ...]

    @property
    def steps(self) -> list[str]:
        return [migration.__name__ for migration in self.migrations]


def open_for_writing(path: Path, schema: Schema, create: bool) -> Connection:
    """With the newest schema; StoreError when the file is something else or somebody writes it."""
    connection = connect(path, "rwc" if create else "rw")
    try:
        applied(connection, schema)
        become_writer(connection)
        migrate(connection, schema)
    except BaseException:
        connection.close()
        raise
    return connection


def open_for_reading(path: Path, schema: Schema) -> Connection:
    """StoreError unless its schema is the newest: a reader cannot migrate."""
    connection = connect(path, "ro")
    try:
        require_newest(connection, schema)
    except BaseException:
        connection.close()
        raise
    return connection


def applied(connection: Connection, schema: Schema) -> list[str]:
    """Names of the migrations this database has had; none for an empty one.

    StoreError when it is something else's database or was written by a newer version.
    """
    identity = connection.scalar("PRAGMA application_id")
    query = "SELECT name FROM sqlite_master WHERE type = 'table'"
    tables = {name for (name,) in connection.rows(query)}
    if identity != schema.application_id and not tables <= {RECORD}:
        raise StoreError(
            f"{connection.path}: an SQLite database, but not a tagmap {schema.name} database"
        )
    if RECORD not in tables:
        return []
    query = f"SELECT name FROM {RECORD} WHERE migration_set = ? ORDER BY id"
    names = [name for (name,) in connection.rows(query, [schema.name])]
    if names != schema.steps[: len(names)]:
        unknown = sorted(set(names) - set(schema.steps)) or names
        raise StoreError(
            f"{connection.path}: written by a newer version of tagmap: "
            f"its schema has {', '.join(unknown)}, this version knows {', '.join(schema.steps)}"
        )
    return names


def migrate(connection: Connection, schema: Schema) -> None:
    """Bring the database to the newest schema. A migration that fails leaves no trace."""
    if applied(connection, schema) == schema.steps:
        return
    from sqlite_utils import Database, Migrations

    steps = Migrations(schema.name)
    for migration in schema.migrations:
        steps(name=migration.__name__)(migration)
    with naming(connection.path):
        steps.apply(Database(connection.raw, execute_plugins=False))


def require_newest(connection: Connection, schema: Schema) -> None:
    names = applied(connection, schema)
    if names != schema.steps:
        missing = ", ".join(schema.steps[len(names) :])
        raise StoreError(
            f"{connection.path}: older than this version of tagmap (lacks {missing}); "
            "opening it once for writing brings it up to date"
        )


def objects(schema: Schema) -> dict[str, str]:
    """The definitions of all tables, indices and triggers of a database fresh from `schema`."""
    from sqlite_utils import Database

    db = Database(memory=True)
    for migration in schema.migrations:
        migration(db)
    rows = db.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL").fetchall()
    db.close()
    return dict(rows)


def _append_only(db: "Database", *tables: str) -> None:
    for table in tables:
        for verb in ("UPDATE", "DELETE"):
            db.execute(
                f"CREATE TRIGGER {table}_no_{verb.lower()} BEFORE {verb} ON {table} "
                f"BEGIN SELECT RAISE(ABORT, '{table} is append-only'); END"
            )


def observations(db: "Database") -> None:
    """What robots reported and people surveyed: facts.

    Vectors are little-endian float64, a hello is its message; p_false has no column type, as REAL
    would not keep every bit (-0.0). `sessions` keeps count of what is
    stored and not withdrawn, so that nobody has to count rows.
    """
    db.execute(f"PRAGMA application_id = {SITE.application_id}")
    db.execute(
        """CREATE TABLE site (
            id INTEGER PRIMARY KEY CHECK (id = 1),
            name TEXT NOT NULL)"""
    )
    db.execute(
        """CREATE TABLE robots (
            id INTEGER PRIMARY KEY,
            name TEXT NOT NULL UNIQUE,
            number INTEGER UNIQUE)"""
    )
    db.execute(
        """CREATE TABLE sessions (
            id INTEGER PRIMARY KEY,
            robot_id INTEGER NOT NULL REFERENCES robots (id),
            session TEXT NOT NULL,
            hello BLOB,
            keyframes INTEGER NOT NULL DEFAULT 0,
            sightings INTEGER NOT NULL DEFAULT 0,
            UNIQUE (robot_id, session))"""
    )
    db.execute(
        """CREATE TABLE keyframes (
            id INTEGER PRIMARY KEY,
            session_id INTEGER NOT NULL REFERENCES sessions (id),
            seq INTEGER NOT NULL CHECK (seq >= 1),
            t_ns INTEGER NOT NULL,
            T_prev_cur BLOB,
            odom_cov BLOB,
            T_base_cam BLOB NOT NULL,
            UNIQUE (session_id, seq))"""
    )
    db.execute(
        """CREATE TABLE sightings (
            keyframe_id INTEGER NOT NULL REFERENCES keyframes (id),
            i INTEGER NOT NULL,
            tag TEXT NOT NULL,
            id_by TEXT NOT NULL,
            p_false NOT NULL,
            lease INTEGER,
            form TEXT NOT NULL,
            z BLOB NOT NULL,
            cov BLOB NOT NULL,
            memory BLOB,
            PRIMARY KEY (keyframe_id, i)) WITHOUT ROWID"""
    )
    db.execute(
        """CREATE TABLE refusals (
            id INTEGER PRIMARY KEY,
            session_id INTEGER NOT NULL REFERENCES sessions (id),
            seq INTEGER NOT NULL CHECK (seq >= 0),
            reason TEXT NOT NULL,
            t_ns INTEGER NOT NULL,
            UNIQUE (session_id, seq))"""
    )
    db.execute(
        """CREATE TABLE surveys (
            id INTEGER PRIMARY KEY,
            tag TEXT NOT NULL,
            p_m BLOB NOT NULL,
            sigma_m REAL NOT NULL CHECK (sigma_m > 0),
            t_ns INTEGER NOT NULL,
            UNIQUE (tag, t_ns))"""
    )
    db.execute(
        "CREATE TRIGGER sessions_one_hello BEFORE UPDATE OF hello ON sessions "
        "WHEN OLD.hello IS NOT NULL BEGIN SELECT RAISE(ABORT, 'a session has one hello'); END"
    )
    _append_only(db, "keyframes", "sightings", "surveys")


def maps(db: "Database") -> None:
    """What was derived from the facts: versions. Poses are kept of the newest version only.

    A row of `keyframe_poses` is a run of one session's poses in time order, so that a new version
    replaces them quickly: seq and t_ns as little-endian int64, T without its last row.
    """
    db.execute(
        """CREATE TABLE map_versions (
            version INTEGER PRIMARY KEY CHECK (version >= 1),
            t_ns INTEGER NOT NULL,
            cause TEXT NOT NULL,
            gauge TEXT NOT NULL,
            moved BLOB,
            tags INTEGER NOT NULL,
            withheld INTEGER NOT NULL,
            summary TEXT NOT NULL)"""
    )
    db.execute(
        """CREATE TABLE tag_estimates (
            version INTEGER NOT NULL REFERENCES map_versions (version),
            tag TEXT NOT NULL,
            p_m BLOB,
            cov BLOB,
            state TEXT NOT NULL,
            n INTEGER NOT NULL,
            PRIMARY KEY (version, tag)) WITHOUT ROWID"""
    )
    db.execute(
        """CREATE TABLE keyframe_poses (
            session_id INTEGER NOT NULL REFERENCES sessions (id),
            first_t_ns INTEGER NOT NULL,
            last_t_ns INTEGER NOT NULL,
            version INTEGER NOT NULL REFERENCES map_versions (version),
            seq BLOB NOT NULL,
            t_ns BLOB NOT NULL,
            T_map_base BLOB NOT NULL,
            cov BLOB)"""
    )
    db.execute("CREATE INDEX keyframe_poses_by_time ON keyframe_poses (session_id, first_t_ns)")
    _append_only(db, "map_versions", "tag_estimates")


def memories(db: "Database") -> None:
    """What robots read in the memories of tags: facts. A reading that says the same as the one
    before is in its keyframe only.
    """
    db.execute(
        """CREATE TABLE memory_readings (
            id INTEGER PRIMARY KEY,
            tag TEXT NOT NULL,
            robot_id INTEGER NOT NULL REFERENCES robots (id),
            memory BLOB,
            t_ns INTEGER NOT NULL,
            job INTEGER,
            outcome TEXT,
            reason TEXT)"""
    )
    _append_only(db, "memory_readings")


def condensing(db: "Database") -> None:
    """What old keyframes were condensed into, and which: the solver goes on from there.

    Poses that are not `alive` are final; a new version replaces the others.
    """
    db.execute(
        """CREATE TABLE condensed (
            id INTEGER PRIMARY KEY CHECK (id = 1),
            serial INTEGER NOT NULL,
            version INTEGER NOT NULL REFERENCES map_versions (version),
            content BLOB NOT NULL)"""
    )
    db.execute(
        """CREATE TABLE covered (
            session_id INTEGER NOT NULL REFERENCES sessions (id),
            first_seq INTEGER NOT NULL CHECK (first_seq >= 1),
            last_seq INTEGER NOT NULL CHECK (last_seq >= first_seq),
            PRIMARY KEY (session_id, first_seq)) WITHOUT ROWID"""
    )
    db.execute("ALTER TABLE keyframe_poses ADD COLUMN alive INTEGER NOT NULL DEFAULT 1")


def archiving(db: "Database") -> None:
    """Which condensed keyframes have left. Only those may; of old versions, only tags and summary.

    `sessions.archived` and `archived_sightings` count them; `keyframes` and `sightings` still do.
    """
    db.execute(
        """CREATE TABLE archived (
            session_id INTEGER NOT NULL REFERENCES sessions (id),
            first_seq INTEGER NOT NULL CHECK (first_seq >= 1),
            last_seq INTEGER NOT NULL CHECK (last_seq >= first_seq),
            PRIMARY KEY (session_id, first_seq)) WITHOUT ROWID"""
    )
    db.execute("ALTER TABLE sessions ADD COLUMN archived INTEGER NOT NULL DEFAULT 0")
    db.execute("ALTER TABLE sessions ADD COLUMN archived_sightings INTEGER NOT NULL DEFAULT 0")
    for table in ("keyframes", "sightings", "tag_estimates"):
        db.execute(f"DROP TRIGGER {table}_no_delete")
    db.execute("DROP TRIGGER map_versions_no_update")
    covered = (
        "SELECT 1 FROM covered WHERE session_id = {0}.session_id "
        "AND first_seq <= {0}.seq AND {0}.seq <= last_seq"
    )
    db.execute(
        "CREATE TRIGGER keyframes_no_delete BEFORE DELETE ON keyframes WHEN NOT EXISTS ("
        + covered.format("OLD")
        + ") BEGIN SELECT RAISE(ABORT, 'keyframes is append-only but for condensed ones'); END"
    )
    db.execute(
        "CREATE TRIGGER sightings_no_delete BEFORE DELETE ON sightings WHEN NOT EXISTS ("
        "SELECT 1 FROM keyframes AS k WHERE k.id = OLD.keyframe_id AND EXISTS ("
        + covered.format("k")
        + ")) BEGIN SELECT RAISE(ABORT, 'sightings is append-only but for condensed ones'); END"
    )
    db.execute(
        "CREATE TRIGGER tag_estimates_no_delete BEFORE DELETE ON tag_estimates "
        "WHEN OLD.version = (SELECT max(version) FROM map_versions) "
        "BEGIN SELECT RAISE(ABORT, 'tag_estimates is append-only but for old versions'); END"
    )
    same = " AND ".join(
        f"NEW.{name} IS OLD.{name}"
        for name in ("version", "t_ns", "cause", "gauge", "moved", "tags", "withheld")
    )
    db.execute(
        "CREATE TRIGGER map_versions_no_update BEFORE UPDATE ON map_versions "
        f"WHEN NOT (NEW.summary = '{{}}' AND {same}) "
        "BEGIN SELECT RAISE(ABORT, 'map_versions is append-only but for old summaries'); END"
    )


def memory_surveys(db: "Database") -> None:
    """What people surveyed as tags tell it, the last row of a tag counts; without a position its
    memory says so no more. A tag that operators surveyed keeps what they said.
    """
    db.execute(
        """CREATE TABLE memory_surveys (
            id INTEGER PRIMARY KEY,
            tag TEXT NOT NULL,
            p_m BLOB,
            cov BLOB,
            robot_id INTEGER REFERENCES robots (id),
            t_ns INTEGER NOT NULL)"""
    )
    _append_only(db, "memory_surveys")


def outbox(db: "Database") -> None:
    """An agent's messages until they are settled, and where its sources were.

    A refusal that is told after its message was dropped is kept without the payload.
    """
    db.execute(f"PRAGMA application_id = {OUTBOX.application_id}")
    db.execute("CREATE TABLE owner (id INTEGER PRIMARY KEY CHECK (id = 1), name TEXT NOT NULL)")
    db.execute("CREATE TABLE sources (name TEXT PRIMARY KEY, cursor INTEGER NOT NULL)")
    db.execute(
        """CREATE TABLE sessions (
            id INTEGER PRIMARY KEY,
            session TEXT NOT NULL UNIQUE,
            last_seq INTEGER NOT NULL)"""
    )
    for table, columns in (
        ("unsettled", "payload BLOB NOT NULL"),
        ("refused", "reason TEXT NOT NULL, payload BLOB"),
    ):
        db.execute(
            f"""CREATE TABLE {table} (
                session_id INTEGER NOT NULL REFERENCES sessions (id),
                seq INTEGER NOT NULL,
                {columns},
                PRIMARY KEY (session_id, seq))"""
        )


SITE = Schema(
    "site",
    0x7461676D,
    (observations, maps, memories, condensing, archiving, memory_surveys),
)
OUTBOX = Schema("outbox", 0x7461676F, (outbox,))
