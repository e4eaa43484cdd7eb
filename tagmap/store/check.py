"""Is a site database what it should be? Looks at every row; changes nothing."""

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path

import msgspec
import numpy as np

from tagmap.errors import RecordRefused, StoreError
from tagmap.records import Hello, Keyframe, MapVersion, Tag, decode, encode
from tagmap.records.base import check_covariance, check_finite
from tagmap.store import archive, keyframes, maps
from tagmap.store.blobs import unpack
from tagmap.store.connection import Connection, connect
from tagmap.store.migrations import SITE, objects, require_newest
from tagmap.store.rows import SessionPoses

MOST_OF_A_KIND = 20
_INVALID = (RecordRefused, StoreError, msgspec.DecodeError, ValueError, TypeError, KeyError)


def check(path: Path) -> list[str]:
    """What is wrong, one line each; nothing when all is well. Never raises for a bad file.

    The service may go on writing: what is checked is the state at the beginning.
    """
    try:
        db = connect(path, "ro")
    except StoreError as error:
        return [str(error)]
    try:
        db.execute("BEGIN")
        found = _all_of(db, [_integrity]) or _all_of(db, [_schema])
        return found or _all_of(db, CONTENTS)
    except StoreError as error:
        return [str(error)]
    finally:
        db.close()


def _all_of(db: Connection, checks: Sequence[Callable[[Connection], Iterator[str]]]) -> list[str]:
    problems: list[str] = []
    for one in checks:
        try:
            found = one(db)
            problems += islice(found, MOST_OF_A_KIND)
            more = sum(1 for _ in found)
            if more:
                problems.append(f"and {more} more of that kind")
        except StoreError as error:
            problems.append(str(error))
    return problems


def _integrity(db: Connection) -> Iterator[str]:
    for (text,) in db.rows("PRAGMA integrity_check"):
        if text != "ok":
            yield f"{db.path}: damaged: {' '.join(text.split())}"


def _schema(db: Connection) -> Iterator[str]:
    require_newest(db, SITE)
    found: dict[str, str | None] = dict(db.rows("SELECT name, sql FROM sqlite_master"))
    for name, sql in objects(SITE).items():
        if name not in found:
            yield f"schema: {name} is missing"
        elif found[name] != sql:
            yield f"schema: {name} is not as the migrations made it"


def _references(db: Connection) -> Iterator[str]:
    for table, rowid, parent, _ in db.rows("PRAGMA foreign_key_check"):
        which = "a row" if rowid is None else f"row {rowid}"
        yield f"{table}: {which} refers to one of {parent} that does not exist"


def _site(db: Connection) -> Iterator[str]:
    names = db.rows("SELECT name FROM site")
    if len(names) != 1:
        yield f"site: {len(names)} rows, expected 1"


def _sessions(db: Connection) -> Iterator[str]:
    rows = db.rows(
        "SELECT (SELECT name FROM site), robots.name, number, session, hello FROM sessions "
        "JOIN robots ON robots.id = robot_id WHERE hello IS NOT NULL"
    )
    for site, robot, number, session, payload in rows:
        try:
            hello = decode(Hello, payload)
        except _INVALID as error:
            yield f"session {robot} {session}: hello: {error}"
            continue
        said = (hello.site, hello.robot, hello.number, hello.session)
        if said != (site, robot, number, session):
            yield f"session {robot} {session}: its hello is of {said}"
    yield from _tallies(db)


def _tallies(db: Connection) -> Iterator[str]:
    """The counts kept in `sessions`; withdrawn keyframes do not count."""
    rows = db.rows(
        "SELECT robots.name, session, sessions.keyframes - sessions.archived, "
        "sessions.sightings - sessions.archived_sightings, "
        "count(keyframes.id), coalesce(sum((SELECT count(*) FROM sightings "
        "WHERE keyframe_id = keyframes.id)), 0) "
        "FROM sessions JOIN robots ON robots.id = robot_id "
        "LEFT JOIN keyframes ON keyframes.session_id = sessions.id AND NOT EXISTS "
        "(SELECT 1 FROM refusals WHERE session_id = sessions.id AND seq = keyframes.seq) "
        "GROUP BY sessions.id"
    )
    for robot, session, said_keyframes, said_sightings, n_keyframes, n_sightings in rows:
        for what, said, n in (
            ("keyframes", said_keyframes, n_keyframes),
            ("sightings", said_sightings, n_sightings),
        ):
            if said != n:
                yield f"session {robot} {session}: {n} {what} stored, expected {said}"


def _keyframes(db: Connection) -> Iterator[str]:
    site = db.scalar("SELECT coalesce(max(name), '') FROM site")
    for row, sightings in keyframes.stored_rows(db):
        try:
            keyframe = keyframes.keyframe_of(db, site, row, sightings)
            decode(Keyframe, encode(keyframe))
        except _INVALID as error:
            yield f"keyframe {row[0]} ({row[1]}, {row[2]}, {row[3]}): {error}"
        if [i for _, i, *_ in sightings] != list(range(len(sightings))):
            yield f"keyframe {row[0]}: a sighting is missing"


def _surveys(db: Connection) -> Iterator[str]:
    for tag, p_m, sigma_m in db.rows("SELECT tag, p_m, sigma_m FROM surveys"):
        try:
            check_finite("p_m", unpack(p_m), [2, 3])
            check_finite("sigma_m", [sigma_m], [1])
        except _INVALID as error:
            yield f"survey of tag {tag}: {error}"
    for tag, p_m, cov in db.rows("SELECT tag, p_m, cov FROM memory_surveys"):
        if p_m is None and cov is None:
            continue
        try:
            check_finite("p_m", unpack(p_m), [3])
            check_covariance("cov", unpack(cov), 3)
        except _INVALID as error:
            yield f"survey in the memory of tag {tag}: {error}"


def _maps(db: Connection) -> Iterator[str]:
    numbers = [number for (number,) in db.rows("SELECT version FROM map_versions ORDER BY version")]
    if numbers != list(range(1, len(numbers) + 1)):
        yield f"map versions are not contiguous: {len(numbers)} of them, the last is {numbers[-1]}"
    for number in numbers:
        yield from _version(db, number)
    yield from _poses(db, max(numbers, default=0))


def _version(db: Connection, number: int) -> Iterator[str]:
    try:
        decode(MapVersion, encode(maps.read_version(db, number)))
        maps.read_summary(db, number)
    except _INVALID as error:
        yield f"map version {number}: {error}"
    try:
        tags = maps.read_tags(db, number)
    except _INVALID as error:
        yield f"map version {number}: tags: {error}"
        return
    for tag in tags:
        try:
            _check_tag(tag)
        except _INVALID as error:
            yield f"map version {number}, tag {tag.tag}: {error}"


def _check_tag(tag: Tag) -> None:
    decode(Tag, encode(tag))
    if tag.state != "retired" and (tag.p_m is None) != (tag.state == "withheld"):
        raise ValueError(f"is {tag.state} with p_m {tag.p_m}")
    if tag.p_m is not None:
        check_finite("p_m", tag.p_m, [2, 3])
    if tag.p_m is not None and tag.cov is not None:
        check_covariance("cov", tag.cov, len(tag.p_m))


def _condensed(db: Connection) -> Iterator[str]:
    newest = db.scalar("SELECT coalesce(max(version), 0) FROM map_versions")
    runs = db.rows("SELECT session_id, first_seq, last_seq FROM covered ORDER BY 1, 2")
    rows = db.rows("SELECT version FROM condensed")
    if runs and not rows:
        yield "covered: keyframes are said to be condensed, but there is nothing condensed"
    for (version,) in rows:
        if version > newest:
            yield f"condensed: is of version {version}, the newest is {newest}"
    end = (0, 0)
    for session_id, first, last in runs:
        if (session_id, first) <= end:
            yield f"covered: seq {first} of session {session_id} twice"
        end = session_id, last
        count = "SELECT count(*) FROM keyframes WHERE session_id = ? AND seq BETWEEN ? AND ?"
        n = db.scalar(count, [session_id, first, last])
        n += sum(
            max(0, min(last, b) - max(first, a) + 1) for a, b in archive.runs_of(db, session_id)
        )
        if n != last - first + 1:
            yield f"covered: session {session_id}: {n} of seq {first}..{last} stored"


def _poses(db: Connection, newest: int) -> Iterator[str]:
    for session_id, session in db.rows("SELECT id, session FROM sessions"):
        seqs = {
            q for (q,) in db.rows("SELECT seq FROM keyframes WHERE session_id = ?", [session_id])
        }
        for first, last in archive.runs_of(db, session_id):
            seqs.update(range(first, last + 1))
        runs = (
            "SELECT rowid, version, alive, first_t_ns, last_t_ns FROM keyframe_poses "
            "WHERE session_id = ?"
        )
        for rowid, version, alive, first_t_ns, last_t_ns in db.rows(runs, [session_id]):
            try:
                _check_run(maps.read_run(db, rowid), first_t_ns, last_t_ns, seqs)
                if version > newest or (alive and version < newest):
                    raise ValueError(f"of version {version}, the newest is {newest}")
            except _INVALID as error:
                yield f"keyframe_poses of session {session}, row {rowid}: {error}"


def _check_run(poses: SessionPoses, first_t_ns: int, last_t_ns: int, seqs: set[int]) -> None:
    for values in (poses.T, poses.cov):
        if values is not None and not np.isfinite(values).all():
            raise ValueError("holds numbers that are not finite")
    span = (poses.t_ns[0], poses.t_ns[-1])
    if span != (first_t_ns, last_t_ns) or (np.diff(poses.t_ns) < 0).any():
        raise ValueError("is not in time order")
    unknown = sorted(set(poses.seqs.tolist()) - seqs)
    if unknown:
        raise ValueError(f"is of keyframes that do not exist: seq {unknown[:5]}")


def _archived(db: Connection) -> Iterator[str]:
    for session_id, n in db.rows("SELECT id, archived FROM sessions"):
        runs = archive.runs_of(db, session_id)
        if sum(last - first + 1 for first, last in runs) != n:
            yield f"archived: of session {session_id}, {n} keyframes expected"
        for first, last in runs:
            both = "SELECT count(*) FROM keyframes WHERE session_id = ? AND seq BETWEEN ? AND ?"
            if db.scalar(both, [session_id, first, last]):
                yield f"archived: session {session_id}, seq {first}..{last} stored as well"


CONTENTS = [_references, _site, _sessions, _keyframes, _surveys, _maps, _condensed, _archived]
