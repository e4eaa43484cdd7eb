"""Map versions with their tags, and the poses of the newest one."""

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Any

import msgspec
import numpy as np

from tagmap.conventions import Array
from tagmap.errors import StoreError
from tagmap.records import MapVersion, Tag
from tagmap.store import condensed
from tagmap.store.blobs import pack, pack_transform, unpack, unpack_transform
from tagmap.store.connection import Connection, Row
from tagmap.store.rows import PoseRow, SessionPoses, Step

RUN = 512

_VERSIONS = "SELECT version, t_ns, cause, gauge, moved, tags, withheld FROM map_versions"
_TAGS = (
    "SELECT tag, p_m, cov, state, n, version, gauge "
    "FROM tag_estimates JOIN map_versions USING (version) WHERE version = ? ORDER BY tag"
)
_POSES = (
    "SELECT robots.name, sessions.session, seq, t_ns, T_map_base, cov FROM keyframe_poses "
    "JOIN sessions ON sessions.id = session_id JOIN robots ON robots.id = robot_id "
)


def insert_version(
    db: Connection,
    version: MapVersion,
    tags: Iterable[Tag],
    poses: Iterable[SessionPoses],
    summary: dict[str, Any],
    step: Step,
) -> None:
    """To be called inside a transaction. StoreError unless the version follows the newest."""
    newest = db.scalar("SELECT coalesce(max(version), 0) FROM map_versions")
    if version.version != newest + 1:
        raise StoreError(f"{db.path}: map version {version.version}, expected {newest + 1}")
    db.execute(
        "INSERT INTO map_versions VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        [
            version.version,
            version.t_ns,
            version.cause,
            version.gauge,
            None if version.moved is None else pack_transform(version.moved),
            version.tags,
            version.withheld,
            msgspec.json.encode(summary).decode(),
        ],
    )
    rows = [_tag_row(db, version, tag) for tag in tags]
    db.executemany("INSERT INTO tag_estimates VALUES (?, ?, ?, ?, ?, ?)", rows)
    db.execute("DELETE FROM keyframe_poses" + ("" if step.afresh else " WHERE alive"))
    if step.T_new_old is not None:
        _move_poses(db, step.T_new_old)
    for session in poses:
        runs = _pose_runs(_session_id(db, session), version.version, session)
        db.executemany("INSERT INTO keyframe_poses VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", runs)
    if step.afresh or step.condensed is not None:
        condensed.replace(db, version.version, step.condensed)
        _expect_archived(db)


def read_versions(db: Connection) -> list[MapVersion]:
    """Oldest first."""
    return [_version(row) for row in db.rows(f"{_VERSIONS} ORDER BY version")]


def read_latest(db: Connection) -> MapVersion | None:
    row = db.row(f"{_VERSIONS} ORDER BY version DESC LIMIT 1")
    return None if row is None else _version(row)


def read_version(db: Connection, version: int) -> MapVersion:
    """Of a version that exists."""
    return _version(db.rows(f"{_VERSIONS} WHERE version = ?", [version])[0])


def read_summary(db: Connection, version: int) -> dict[str, Any] | None:
    row = db.row("SELECT summary FROM map_versions WHERE version = ?", [version])
    return None if row is None else msgspec.json.decode(row[0], type=dict[str, Any])


def read_tags(db: Connection, version: int) -> list[Tag]:
    """In the order of their ids."""
    return [
        Tag(
            tag=tag,
            p_m=None if p_m is None else unpack(p_m),
            cov=None if cov is None else unpack(cov),
            state=state,
            n=n,
            version=number,
            gauge=gauge,
        )
        for tag, p_m, cov, state, n, number, gauge in db.rows(_TAGS, [version])
    ]


def read_poses(db: Connection) -> list[SessionPoses]:
    """One entry per session, in time order."""
    runs = map(_poses, db.rows(f"{_POSES} ORDER BY session_id, first_t_ns"))
    by_session = groupby(runs, key=lambda run: (run.robot, run.session))
    return [_joined(list(session)) for _, session in by_session]


def read_run(db: Connection, rowid: int) -> SessionPoses:
    """One stored run of poses."""
    return _poses(db.rows(f"{_POSES} WHERE keyframe_poses.rowid = ?", [rowid])[0])


def read_trajectory(db: Connection, robot: str) -> Iterator[PoseRow]:
    query = f"{_POSES} WHERE robots.name = ? ORDER BY first_t_ns, session_id"
    for row in db.rows(query, [robot]):
        poses = _poses(row)
        for i in range(len(poses.seqs)):
            yield _pose_row(poses, i)


def read_bracket(db: Connection, robot: str, t_ns: int) -> tuple[PoseRow, PoseRow] | None:
    """The poses at or before and at or after `t_ns`, of the newest session that spans it."""
    spans = db.rows(
        "SELECT session_id FROM keyframe_poses "
        "JOIN sessions ON sessions.id = session_id JOIN robots ON robots.id = robot_id "
        "WHERE robots.name = ? GROUP BY session_id "
        "HAVING min(first_t_ns) <= ? AND max(last_t_ns) >= ? "
        "ORDER BY min(first_t_ns) DESC",
        [robot, t_ns, t_ns],
    )
    if not spans:
        return None
    session_id = spans[0][0]
    side = f"{_POSES} WHERE session_id = ? AND first_t_ns <= ? ORDER BY first_t_ns DESC LIMIT 1"
    before = _poses(db.rows(side, [session_id, t_ns])[0])
    i = int(np.searchsorted(before.t_ns, t_ns, side="right")) - 1
    if before.t_ns[i] == t_ns:
        return _pose_row(before, i), _pose_row(before, i)
    if i + 1 < len(before.t_ns):
        return _pose_row(before, i), _pose_row(before, i + 1)
    side = f"{_POSES} WHERE session_id = ? AND first_t_ns > ? ORDER BY first_t_ns LIMIT 1"
    return _pose_row(before, i), _pose_row(_poses(db.rows(side, [session_id, t_ns])[0]), 0)


def read_alive(db: Connection) -> list[SessionPoses]:
    """Those poses that the next version may move, by session in time order."""
    runs = map(_poses, db.rows(f"{_POSES} WHERE alive ORDER BY session_id, first_t_ns"))
    by_session = groupby(runs, key=lambda run: (run.robot, run.session))
    return [_joined(list(session)) for _, session in by_session]


def _expect_archived(db: Connection) -> None:
    """Nothing that has left can be said anew: StoreError where a version has not got it."""
    lost = db.row(
        "SELECT session_id FROM archived AS a WHERE NOT EXISTS (SELECT 1 FROM covered AS c WHERE "
        "c.session_id = a.session_id AND c.first_seq <= a.first_seq AND a.last_seq <= c.last_seq)"
    )
    if lost is not None:
        raise StoreError(f"{db.path}: a map version without keyframes that have been archived")


def _move_poses(db: Connection, T_new_old: Array) -> None:
    """All that are there, a run at a time."""
    for (rowid,) in db.rows("SELECT rowid FROM keyframe_poses"):
        T = _upper(T_new_old @ read_run(db, rowid).T)
        db.execute("UPDATE keyframe_poses SET T_map_base = ? WHERE rowid = ?", [T, rowid])


def _version(row: Row) -> MapVersion:
    version, t_ns, cause, gauge, moved, tags, withheld = row
    return MapVersion(
        version=version,
        t_ns=t_ns,
        cause=cause,
        gauge=gauge,
        moved=None if moved is None else unpack_transform(moved),
        tags=tags,
        withheld=withheld,
    )


def _tag_row(db: Connection, version: MapVersion, tag: Tag) -> Row:
    if (tag.version, tag.gauge) != (version.version, version.gauge):
        raise StoreError(
            f"{db.path}: tag {tag.tag} is of version {tag.version} ({tag.gauge}), "
            f"expected {version.version} ({version.gauge})"
        )
    return (
        version.version,
        tag.tag,
        None if tag.p_m is None else pack(tag.p_m),
        None if tag.cov is None else pack(tag.cov),
        tag.state,
        tag.n,
    )


def _session_id(db: Connection, poses: SessionPoses) -> int:
    row = db.row(
        "SELECT sessions.id FROM sessions JOIN robots ON robots.id = robot_id "
        "WHERE robots.name = ? AND session = ?",
        [poses.robot, poses.session],
    )
    if row is None:
        raise StoreError(f"{db.path}: poses of an unknown session {poses.robot} {poses.session}")
    return int(row[0])


def _pose_runs(session_id: int, version: int, poses: SessionPoses) -> Iterator[Row]:
    order = np.lexsort((poses.seqs, poses.t_ns))
    for start in range(0, len(order), RUN):
        part = order[start : start + RUN]
        t_ns = poses.t_ns[part]
        yield (
            session_id,
            int(t_ns[0]),
            int(t_ns[-1]),
            version,
            poses.seqs[part].astype("<i8").tobytes(),
            t_ns.astype("<i8").tobytes(),
            _upper(poses.T[part]),
            None if poses.cov is None else poses.cov[part].astype("<f8").tobytes(),
            poses.alive,
        )


def _upper(T: Array) -> bytes:
    """Transforms (n, d, d) without their last rows."""
    return T[:, :-1].astype("<f8").tobytes()


def _poses(row: Row) -> SessionPoses:
    robot, session, seq, t_ns, T, cov = row
    seqs = np.frombuffer(seq, "<i8")
    n = len(seqs)
    return SessionPoses(
        robot=robot,
        session=session,
        seqs=seqs.astype(np.int64),
        t_ns=np.frombuffer(t_ns, "<i8").astype(np.int64),
        T=_with_last_row(np.frombuffer(T, "<f8").reshape(n, -1)),
        cov=None if cov is None else np.frombuffer(cov, "<f8").reshape(n, -1).astype(np.float64),
    )


def _joined(runs: list[SessionPoses]) -> SessionPoses:
    covs = [run.cov for run in runs if run.cov is not None]
    return SessionPoses(
        robot=runs[0].robot,
        session=runs[0].session,
        seqs=np.concatenate([run.seqs for run in runs]),
        t_ns=np.concatenate([run.t_ns for run in runs]),
        T=np.concatenate([run.T for run in runs]),
        cov=np.concatenate(covs) if covs else None,
    )


def _with_last_row(upper: Array) -> Array:
    """(n, 12) or (n, 6) to (n, 4, 4) or (n, 3, 3)."""
    d = {12: 4, 6: 3}[upper.shape[1]]
    T = np.zeros((len(upper), d, d))
    T[:, :-1] = upper.reshape(-1, d - 1, d)
    T[:, -1, -1] = 1.0
    return T


def _pose_row(poses: SessionPoses, i: int) -> PoseRow:
    return PoseRow(
        session=poses.session,
        seq=int(poses.seqs[i]),
        t_ns=int(poses.t_ns[i]),
        T=poses.T[i],
        cov=None if poses.cov is None else poses.cov[i],
    )
