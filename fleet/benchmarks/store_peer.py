"""The way of writing that the store was measured against: sqlite-utils, as its manual shows it."""

import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from sqlite_utils import Database

from tagmap.records import Hello, Keyframe
from tagmap.store import Batch, SiteStore
from tagmap.store.blobs import pack, pack_transform


def insert_all(db: Path, parts: Sequence[list[Keyframe]]) -> float:
    """Seconds for the same rows in the same tables, equally durable, a transaction per part.

    Rows that are there already are ignored; nothing is counted or overruled.
    """
    sessions = {k.robot: k for part in parts for k in part}
    with SiteStore.open(db, next(iter(sessions.values())).site) as store:
        store.commit(Batch(hellos=[_hello(n, k) for n, k in enumerate(sessions.values(), start=1)]))
    ids = {robot: n for n, robot in enumerate(sessions, start=1)}
    with closing(Database(db)) as peer:
        peer.execute("PRAGMA synchronous = FULL")
        peer.execute("PRAGMA foreign_keys = ON")
        began_s = time.perf_counter()
        first = 1
        for part in parts:
            with peer.atomic():
                peer.table("keyframes").insert_all(_keyframes(first, ids, part), ignore=True)
                peer.table("sightings").insert_all(_sightings(first, part), ignore=True)
            first += len(part)
        return time.perf_counter() - began_s


def _hello(number: int, k: Keyframe) -> Hello:
    return Hello(
        site=k.site, robot=k.robot, number=number, session=k.session, kind=k.kind, rig=None
    )


def _keyframes(
    first: int, ids: dict[str, int], keyframes: list[Keyframe]
) -> Iterator[dict[str, Any]]:
    for id_, k in enumerate(keyframes, start=first):
        yield {
            "id": id_,
            "session_id": ids[k.robot],
            "seq": k.seq,
            "t_ns": k.t_ns,
            "T_prev_cur": None if k.odom is None else pack_transform(k.odom.T_prev_cur),
            "odom_cov": None if k.odom is None else pack(k.odom.cov),
            "T_base_cam": pack_transform(k.T_base_cam),
        }


def _sightings(first: int, keyframes: list[Keyframe]) -> Iterator[dict[str, Any]]:
    for id_, k in enumerate(keyframes, start=first):
        for i, s in enumerate(k.sightings):
            yield {
                "keyframe_id": id_,
                "i": i,
                "tag": s.tag,
                "id_by": s.id_by,
                "p_false": s.p_false,
                "lease": s.lease,
                "form": s.z.form,
                "z": pack(s.z.values),
                "cov": pack(s.z.cov),
                "memory": s.memory,
            }
