"""What `tagmap map export` writes."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tagmap.cli.ask import Refused, ask
from tagmap.cli.options import Target
from tagmap.errors import DataError
from tagmap.exchange.tags_csv import write_tags_csv
from tagmap.exchange.tum import write_tum

TIMEOUT_S = 60.0


def export_map(target: Target, format_: str, out: Path, robot: str | None) -> dict[str, Any]:
    """Counts of what was written; DataError when it cannot be."""
    data = ask(target, "map", "export", TIMEOUT_S)
    robots = data.pop("robots")
    if robot is not None and robot not in robots:
        raise Refused(f"no poses of robot {robot!r}; there are poses of {robots or 'none'}")
    chosen = robots if robot is None else [robot]
    try:
        if format_ == "csv":
            with out.open("w", encoding="utf-8", newline="") as file:
                return {"out": str(out), "tags": write_tags_csv(file, data["tags"]), "poses": 0}
        if format_ == "json":
            return _write_json(target, data, out, chosen)
        return _write_trajectories(target, out, chosen, single=robot is not None)
    except OSError as error:
        raise DataError(f"{error.filename or out}: cannot be written: {error.strerror}") from None


def _write_json(
    target: Target, data: dict[str, Any], out: Path, robots: list[str]
) -> dict[str, Any]:
    with out.open("w", encoding="utf-8") as file:
        data["trajectories"] = {robot: list(trajectory(target, robot)) for robot in robots}
        json.dump(data, file, indent=1)
    poses = sum(map(len, data["trajectories"].values()))
    return {"out": str(out), "tags": len(data["tags"]), "poses": poses}


def _write_trajectories(
    target: Target, out: Path, robots: list[str], single: bool
) -> dict[str, Any]:
    if not single:
        out.mkdir(parents=True, exist_ok=True)
    poses = 0
    for robot in robots:
        with (out if single else out / f"{robot}.tum").open("w", encoding="utf-8") as file:
            poses += write_tum(file, trajectory(target, robot))
    return {"out": str(out), "tags": 0, "poses": poses}


def trajectory(target: Target, robot: str) -> Iterator[dict[str, Any]]:
    """All poses of a robot in time order, a page at a time."""
    skip = 0
    while page := ask(target, "map", "export", TIMEOUT_S, robot=robot, skip=skip)["poses"]:
        yield from page
        skip += len(page)
