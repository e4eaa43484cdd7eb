"""Keyframes out of tables: the same records that went in."""

from collections import defaultdict
from collections.abc import Iterator

from tagmap.errors import StoreError
from tagmap.records import Keyframe, Measurement, Odometry, Sighting
from tagmap.store.blobs import unpack, unpack_transform
from tagmap.store.connection import Connection, Row, Values

PAGE = 1000

_KEYFRAMES = """
    SELECT keyframes.id, robots.name, sessions.session, seq, t_ns, T_prev_cur, odom_cov, T_base_cam
    FROM keyframes JOIN sessions ON sessions.id = session_id JOIN robots ON robots.id = robot_id
    WHERE {where} ORDER BY {order} LIMIT {limit}"""
_NOT_WITHDRAWN = """NOT EXISTS (SELECT 1 FROM refusals
    WHERE refusals.session_id = keyframes.session_id AND refusals.seq = keyframes.seq)"""
_BY_ID = _KEYFRAMES.format(where="keyframes.id > ?", order="keyframes.id", limit=PAGE)
_NEXT = _KEYFRAMES.format(
    where=f"keyframes.id > ? AND {_NOT_WITHDRAWN}", order="keyframes.id", limit=PAGE
)
_COVERED = """EXISTS (SELECT 1 FROM covered WHERE covered.session_id = keyframes.session_id
    AND first_seq <= keyframes.seq AND keyframes.seq <= last_seq)"""
_UNCOVERED = _KEYFRAMES.format(
    where=f"keyframes.id > ? AND {_NOT_WITHDRAWN} AND NOT {_COVERED}",
    order="keyframes.id",
    limit=PAGE,
)
_OF_SESSION = _KEYFRAMES.format(
    where=f"robots.name = ? AND sessions.session = ? AND seq >= ? AND {_NOT_WITHDRAWN}",
    order="seq",
    limit=PAGE,
)
_SIGHTINGS = "SELECT * FROM sightings WHERE keyframe_id IN ({}) ORDER BY keyframe_id, i"


def read_all(db: Connection, site: str, after_id: int) -> Iterator[tuple[int, Keyframe]]:
    """In insertion order, a page at a time: no transaction stays open in between."""
    return _read(db, _NEXT, site, after_id)


def read_uncovered(db: Connection, site: str, after_id: int) -> Iterator[tuple[int, Keyframe]]:
    """The same without those that are condensed."""
    return _read(db, _UNCOVERED, site, after_id)


def _read(db: Connection, query: str, site: str, after_id: int) -> Iterator[tuple[int, Keyframe]]:
    while page := _page(db, query, [after_id]):
        for row, sightings in page:
            yield row[0], keyframe_of(db, site, row, sightings)
        after_id = page[-1][0][0]


def read_session(
    db: Connection, site: str, robot: str, session: str, from_seq: int
) -> Iterator[Keyframe]:
    """In the order of seq."""
    while page := _page(db, _OF_SESSION, [robot, session, from_seq]):
        for row, sightings in page:
            keyframe = keyframe_of(db, site, row, sightings)
            from_seq = keyframe.seq + 1
            yield keyframe


def stored_rows(db: Connection) -> Iterator[tuple[Row, list[Row]]]:
    """Every keyframe as it is stored, withdrawn or not, with its sightings."""
    after_id = 0
    while page := _page(db, _BY_ID, [after_id]):
        yield from page
        after_id = page[-1][0][0]


def _page(db: Connection, query: str, values: Values) -> list[tuple[Row, list[Row]]]:
    """Of one moment: keyframes leave together with their sightings."""
    sightings: dict[int, list[Row]] = defaultdict(list)
    with db.snapshot():
        rows = db.rows(query, values)
        for row in db.rows(_SIGHTINGS.format(", ".join(str(row[0]) for row in rows))):
            sightings[row[0]].append(row)
    return [(row, sightings[row[0]]) for row in rows]


def keyframe_of(db: Connection, site: str, row: Row, sightings: list[Row]) -> Keyframe:
    """StoreError when what was stored is no longer a valid keyframe."""
    id_, robot, session, seq, t_ns, T_prev_cur, odom_cov, T_base_cam = row
    try:
        odom = None
        if T_prev_cur is not None:
            odom = Odometry(T_prev_cur=unpack_transform(T_prev_cur), cov=unpack(odom_cov))
        return Keyframe(
            site=site,
            robot=robot,
            session=session,
            seq=seq,
            t_ns=t_ns,
            odom=odom,
            T_base_cam=unpack_transform(T_base_cam),
            sightings=tuple(map(_sighting, sightings)),
        )
    except (StoreError, ValueError, TypeError) as error:
        where = f"keyframe {id_} ({robot}, {session}, {seq})"
        raise StoreError(f"{db.path}: {where}: {error}") from error


def _sighting(row: Row) -> Sighting:
    _, _, tag, id_by, p_false, lease, form, z, cov, memory = row
    measured = unpack(z)
    if form == "range_bearing":
        range_m, bearing_rad = measured
        measurement = Measurement(range_m=range_m, bearing_rad=bearing_rad, cov=unpack(cov))
    elif form == "stereo_px":
        measurement = Measurement(stereo_px=measured, cov=unpack(cov))
    elif form == "mono_px":
        measurement = Measurement(mono_px=measured, cov=unpack(cov))
    elif form == "point_cam_m":
        measurement = Measurement(point_cam_m=measured, cov=unpack(cov))
    else:
        raise StoreError(f"unknown form {form!r} of a sighting")
    return Sighting(
        tag=tag, id_by=id_by, p_false=p_false, lease=lease, z=measurement, memory=memory
    )
