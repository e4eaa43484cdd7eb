"""Facts into tables: idempotent by (robot, session, seq), independent of the order of commits.

The last verdict on a seq counts. A keyframe that comes after a refusal takes its place; a refusal
that comes after a keyframe (which was stored before its hello could be held against it) withdraws
it: the row stays, as all rows do, and is no longer read.
"""

from tagmap.records import Hello, Keyframe, Sighting, encode
from tagmap.store.batch import Batch, Inserted, MemorySurvey, Reading, RefusalRow, Survey
from tagmap.store.blobs import pack, pack_transform
from tagmap.store.connection import Connection, Row

_HELLO = "UPDATE sessions SET hello = ? WHERE id = ? AND hello IS NULL"
_NUMBER = "UPDATE robots SET number = ? WHERE id = ? AND number IS NULL"
_KEYFRAME = (
    "INSERT INTO keyframes (id, session_id, seq, t_ns, T_prev_cur, odom_cov, T_base_cam) "
    "SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7 WHERE NOT EXISTS (SELECT 1 FROM archived "
    "WHERE session_id = ?2 AND first_seq <= ?3 AND ?3 <= last_seq) "
    "ON CONFLICT (session_id, seq) DO NOTHING"
)
_SIGHTING = "INSERT INTO sightings VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
_TALLY = "UPDATE sessions SET keyframes = keyframes + ?, sightings = sightings + ? WHERE id = ?"
_REFUSAL = (
    "INSERT INTO refusals (session_id, seq, reason, t_ns) VALUES (?, ?, ?, ?) "
    "ON CONFLICT (session_id, seq) DO NOTHING"
)
_OVERRULE = "DELETE FROM refusals WHERE session_id = ? AND seq = ?"
_SURVEY = (
    "INSERT INTO surveys (tag, p_m, sigma_m, t_ns) VALUES (?, ?, ?, ?) "
    "ON CONFLICT (tag, t_ns) DO NOTHING"
)
_READING = (
    "INSERT INTO memory_readings (tag, robot_id, memory, t_ns, job, outcome, reason) "
    "VALUES (?, ?, ?, ?, ?, ?, ?)"
)
_MEMORY_SURVEY = "INSERT INTO memory_surveys (tag, p_m, cov, robot_id, t_ns) VALUES (?, ?, ?, ?, ?)"


def insert_batch(db: Connection, batch: Batch) -> Inserted:
    """To be called inside a transaction."""
    ids = _Ids(db)
    hellos = sum(_insert_hello(db, ids, hello) for hello in batch.hellos)
    keyframes, sightings = _insert_keyframes(db, ids, batch.keyframes)
    refusals = sum(_insert_refusal(db, ids, refusal) for refusal in batch.refusals)
    surveys = db.executemany(_SURVEY, map(_survey_row, batch.surveys))
    db.executemany(_READING, [_reading_row(ids, reading) for reading in batch.readings])
    db.executemany(_MEMORY_SURVEY, [_memory_row(ids, survey) for survey in batch.memory_surveys])
    return Inserted(hellos, keyframes, sightings, refusals, surveys)


class _Ids:
    """Row ids of robots and sessions, made where there are none yet."""

    def __init__(self, db: Connection) -> None:
        self._db = db
        self._robots: dict[str, int] = {}
        self._sessions: dict[tuple[str, str], int] = {}

    def robot(self, name: str) -> int:
        if name not in self._robots:
            self._db.execute("INSERT INTO robots (name) VALUES (?) ON CONFLICT DO NOTHING", [name])
            query = "SELECT id FROM robots WHERE name = ?"
            self._robots[name] = self._db.scalar(query, [name])
        return self._robots[name]

    def session(self, robot: str, session: str) -> int:
        key = (robot, session)
        if key not in self._sessions:
            values = [self.robot(robot), session]
            insert = "INSERT INTO sessions (robot_id, session) VALUES (?, ?) ON CONFLICT DO NOTHING"
            self._db.execute(insert, values)
            query = "SELECT id FROM sessions WHERE robot_id = ? AND session = ?"
            self._sessions[key] = self._db.scalar(query, values)
        return self._sessions[key]


def _insert_hello(db: Connection, ids: _Ids, hello: Hello) -> int:
    session = ids.session(hello.robot, hello.session)
    stored = db.execute(_HELLO, [encode(hello), session])
    if stored:
        db.execute(_OVERRULE, [session, hello.seq])
        db.execute(_NUMBER, [hello.number, ids.robot(hello.robot)])
    return stored


def _insert_keyframes(db: Connection, ids: _Ids, keyframes: list[Keyframe]) -> tuple[int, int]:
    """Ids are given here, so that which keyframes were new can be read back from them."""
    first = db.scalar("SELECT coalesce(max(id), 0) + 1 FROM keyframes")
    rows = [_keyframe_row(ids, first + n, keyframe) for n, keyframe in enumerate(keyframes)]
    db.executemany(_KEYFRAME, rows)
    new = db.rows("SELECT id, session_id, seq FROM keyframes WHERE id >= ?", [first])
    db.executemany(_OVERRULE, [(session, seq) for _, session, seq in new])
    seen = [(id_, session, keyframes[id_ - first].sightings) for id_, session, _ in new]
    rows = [_sighting_row(id_, i, one) for id_, _, many in seen for i, one in enumerate(many)]
    db.executemany(_SIGHTING, rows)
    db.executemany(_TALLY, [(1, len(many), session) for _, session, many in seen])
    return len(new), len(rows)


def _insert_refusal(db: Connection, ids: _Ids, refusal: RefusalRow) -> int:
    session = ids.session(refusal.robot, refusal.session)
    new = db.execute(_REFUSAL, [session, refusal.seq, refusal.reason, refusal.t_ns])
    if new:
        query = (
            "SELECT -1, -(SELECT count(*) FROM sightings WHERE keyframe_id = keyframes.id), "
            "session_id FROM keyframes WHERE session_id = ? AND seq = ?"
        )
        db.executemany(_TALLY, db.rows(query, [session, refusal.seq]))
    return new


def _keyframe_row(ids: _Ids, id_: int, keyframe: Keyframe) -> Row:
    odom = keyframe.odom
    return (
        id_,
        ids.session(keyframe.robot, keyframe.session),
        keyframe.seq,
        keyframe.t_ns,
        None if odom is None else pack_transform(odom.T_prev_cur),
        None if odom is None else pack(odom.cov),
        pack_transform(keyframe.T_base_cam),
    )


def _sighting_row(keyframe_id: int, i: int, sighting: Sighting) -> Row:
    return (
        keyframe_id,
        i,
        sighting.tag,
        sighting.id_by,
        sighting.p_false,
        sighting.lease,
        sighting.z.form,
        pack(sighting.z.values),
        pack(sighting.z.cov),
        sighting.memory,
    )


def _survey_row(survey: Survey) -> Row:
    return (survey.tag, pack(survey.p_m), survey.sigma_m, survey.t_ns)


def _reading_row(ids: _Ids, reading: Reading) -> Row:
    return (
        reading.tag,
        ids.robot(reading.robot),
        reading.memory,
        reading.t_ns,
        reading.job,
        reading.outcome,
        reading.reason,
    )


def _memory_row(ids: _Ids, survey: MemorySurvey) -> Row:
    return (
        survey.tag,
        None if survey.p_m is None else pack(survey.p_m),
        None if survey.cov is None else pack(survey.cov),
        None if survey.robot is None else ids.robot(survey.robot),
        survey.t_ns,
    )
