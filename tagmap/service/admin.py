"""`admin/<noun>/<verb>`: what the command line asks, answered from the mapper and the database.

A handler gets the arguments and returns data, or a function that reads the rest from the database;
that one runs in the archive's thread and must not touch the mapper. Commands that change something
or wait are the loop's own: see shell.py.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from itertools import islice
from typing import Any, TypeAlias

import msgspec

from tagmap.errors import RecordRefused
from tagmap.mapper import Mapper
from tagmap.mapping.selection import parse
from tagmap.records.arrays import transform
from tagmap.store import PoseRow, SiteStore

Args: TypeAlias = Mapping[str, Any]
Read: TypeAlias = Callable[[SiteStore], Any]

PAGE = 50_000
REFUSALS = 100


def text(args: Args, name: str) -> str:
    value = args.get(name)
    if not isinstance(value, str):
        raise RecordRefused(f"argument {name} is {value!r:.40}, expected a text")
    return value


def count(args: Args, name: str) -> int:
    value = args.get(name, 0)
    if not isinstance(value, int) or not 0 <= value < 2**63:
        raise RecordRefused(f"argument {name} is {value!r:.40}, expected a whole number")
    return value


def flag(args: Args, name: str) -> bool:
    value = args.get(name, False)
    if not isinstance(value, bool):
        raise RecordRefused(f"argument {name} is {value!r:.40}, expected true or false")
    return value


def tags_list(mapper: Mapper, args: Args) -> Any:
    selection = parse({name: str(value) for name, value in args.items()})
    if selection.version is not None and selection.version != mapper.book.number:
        version = selection.version

        def read(store: SiteStore) -> Any:
            tags = store.tags(version)
            gauge = next((v.gauge for v in store.versions() if v.version == version), None)
            if gauge is None:
                raise RecordRefused(f"there is no map version {version}")
            if not tags:
                raise RecordRefused(f"the tags of map version {version} are not kept")
            return _tag_list(version, gauge, selection.of(tags))

        return read
    tags = selection.of(mapper.book.tags.values())
    listed = _tag_list(mapper.book.number, mapper.book.gauge, tags)
    surveys = mapper.surveys.in_force
    for tag in listed["tags"]:
        survey = surveys.get(tag["tag"])
        tag["survey"] = None if survey is None else survey.source
    return listed


def tags_show(mapper: Mapper, args: Args) -> Any:
    name = text(args, "tag")
    tag, survey = mapper.book.tags.get(name), mapper.surveys.in_force.get(name)
    if tag is None and survey is None:
        raise RecordRefused(f"nobody has seen or surveyed tag {name!r}")
    shown: dict[str, Any] = {"tag": name, "state": "not mapped yet", "gauge": mapper.book.gauge}
    return shown | _plain(tag or {}) | {"survey": None if survey is None else asdict(survey)}


def robots_list(mapper: Mapper, _args: Args) -> Any:
    known = {robot: robot_view(mapper, robot) for robot in mapper.ingest.robots}
    gauge = mapper.book.gauge

    def read(store: SiteStore) -> Any:
        rows = {row.robot: asdict(row) for row in store.robots()}
        robots = [known[robot] | rows.get(robot, _UNSTORED) for robot in sorted(known)]
        return {"gauge": gauge, "robots": robots}

    return read


def robots_show(mapper: Mapper, args: Args) -> Any:
    robot = text(args, "robot")
    ledger = mapper.ingest.robots.get(robot)
    if ledger is None:
        raise RecordRefused(f"nothing was ever heard of robot {robot!r}")
    known = robot_view(mapper, robot)
    sessions = [
        {"session": s.session, "contiguous": s.contiguous, "refused": s.refused}
        for s in ledger.sessions.values()
    ]

    def read(store: SiteStore) -> Any:
        rows = {row.robot: asdict(row) for row in store.robots()}
        refusals = [asdict(row) for row in store.refusals(robot, limit=REFUSALS)]
        stored = rows.get(robot, _UNSTORED) | {"sessions": sessions, "refusals": refusals}
        return known | stored

    return read


def map_versions(_mapper: Mapper, _args: Args) -> Any:
    return lambda store: {"versions": _plain(store.versions())}


def map_export(mapper: Mapper, args: Args) -> Any:
    """Without `robot`: the map; with `robot`: a page of its poses, after the first `skip`."""
    if "robot" in args:
        robot, skip = text(args, "robot"), count(args, "skip")
        return lambda store: _trajectory_page(store, robot, skip)
    site, gauge = mapper.site, mapper.book.gauge

    def read(store: SiteStore) -> Any:
        version = store.latest_version()
        robots = sorted({poses.robot for poses in store.poses()})
        head = {"site": site, "gauge": version.gauge if version else gauge}
        return head | {
            "version": _plain(version) if version else None,
            "tags": _plain(store.tags()),
            "robots": robots,
        }

    return read


HANDLERS: dict[tuple[str, str], Callable[[Mapper, Args], Any]] = {
    ("tags", "list"): tags_list,
    ("tags", "show"): tags_show,
    ("robots", "list"): robots_list,
    ("robots", "show"): robots_show,
    ("map", "versions"): map_versions,
    ("map", "export"): map_export,
}

_UNSTORED: dict[str, Any] = {"sessions": 0, "keyframes": 0, "sightings": 0, "refusals": 0}


def robot_view(mapper: Mapper, robot: str) -> dict[str, Any]:
    ledger = mapper.ingest.robots[robot]
    pose = mapper.pose(robot)
    return {
        "robot": robot,
        "number": ledger.number,
        "alive": robot in mapper.alive,
        "last_t_ns": None,
        "pose": None if pose is None else _plain(pose),
        "counters": ledger.counters.as_dict(),
    }


def _tag_list(version: int | None, gauge: str, tags: list[Any]) -> dict[str, Any]:
    return {"version": version, "gauge": gauge, "tags": _plain(tags)}


def _trajectory_page(store: SiteStore, robot: str, skip: int) -> dict[str, Any]:
    version = store.latest_version()
    rows = islice(store.trajectory(robot), skip, skip + PAGE)
    return {"version": version.version if version else None, "poses": list(_poses(rows))}


def _poses(rows: Iterator[PoseRow]) -> Iterator[dict[str, Any]]:
    for row in rows:
        yield {
            "session": row.session,
            "seq": row.seq,
            "t_ns": row.t_ns,
            "T_map_base": _plain(transform(row.T)),
        }


def _plain(record: Any) -> Any:
    return msgspec.to_builtins(record)
