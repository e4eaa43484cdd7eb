"""What `tagmap map export` fetches and writes."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from tagmap.cli.ask import Refused, ask
from tagmap.cli.options import Target
from tagmap.errors import DataError
from tagmap.exchange.tags_csv import write_tags_csv
from tagmap.exchange.tum import write_tum

TIMEOUT_S = 60.0
ATTEMPTS = 5

Poses: TypeAlias = list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One map version: `head` has site, gauge, version, tags; poses by robot, in time order."""

    head: dict[str, Any]
    trajectories: dict[str, Poses]


class _Changed(Exception):
    pass


def export_map(target: Target, format_: str, out: Path, robot: str | None) -> dict[str, Any]:
    """Counts of what was written; DataError when it cannot be. Nothing is written before
    everything is here."""
    snapshot = fetch(target, robot, with_poses=format_ != "csv")
    try:
        if format_ == "csv":
            tags, poses = _write_tags(snapshot, out), 0
        elif format_ == "json":
            tags, poses = _write_json(snapshot, out)
        else:
            tags, poses = 0, _write_trajectories(snapshot, out, single=robot is not None)
    except OSError as error:
        raise DataError(f"{error.filename or out}: cannot be written: {error.strerror}") from None
    return {"out": str(out), "tags": tags, "poses": poses}


def fetch(target: Target, robot: str | None, with_poses: bool) -> Snapshot:
    """Again from the beginning when the map changes meanwhile; Refused when it never rests."""
    for _ in range(ATTEMPTS):
        head = ask(target, "map", "export", TIMEOUT_S)
        robots = head.pop("robots")
        if robot is not None and robot not in robots:
            raise Refused(f"no poses of robot {robot!r}; there are poses of {robots or 'none'}")
        chosen = robots if robot is None else [robot]
        try:
            poses = {one: _trajectory(target, one, head) for one in chosen} if with_poses else {}
        except _Changed:
            continue
        return Snapshot(head, poses)
    raise Refused(f"the map changed during each of {ATTEMPTS} exports; try again")


def _trajectory(target: Target, robot: str, head: dict[str, Any]) -> Poses:
    """A page at a time."""
    poses: Poses = []
    while True:
        page = ask(target, "map", "export", TIMEOUT_S, robot=robot, skip=len(poses))
        if page["version"] != head["version"]["version"]:
            raise _Changed
        if not page["poses"]:
            return poses
        poses += page["poses"]


def _write_tags(snapshot: Snapshot, out: Path) -> int:
    with out.open("w", encoding="utf-8", newline="") as file:
        return write_tags_csv(file, snapshot.head["tags"])


def _write_json(snapshot: Snapshot, out: Path) -> tuple[int, int]:
    with out.open("w", encoding="utf-8") as file:
        json.dump(snapshot.head | {"trajectories": snapshot.trajectories}, file, indent=1)
    return len(snapshot.head["tags"]), sum(map(len, snapshot.trajectories.values()))


def _write_trajectories(snapshot: Snapshot, out: Path, single: bool) -> int:
    if not single:
        out.mkdir(parents=True, exist_ok=True)
    count = 0
    for robot, poses in snapshot.trajectories.items():
        with (out if single else out / f"{robot}.tum").open("w", encoding="utf-8") as file:
            count += write_tum(file, poses)
    return count
