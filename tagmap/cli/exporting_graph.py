"""`tagmap map export --format g2o`: from the database, as the service serves no keyframes."""

from pathlib import Path
from typing import Any

from tagmap.errors import DataError, StoreError
from tagmap.exchange.g2o import write_g2o
from tagmap.exchange.map_graph import MapGraph, MappedSession, graph_of_map
from tagmap.store import SiteStore

ATTEMPTS = 5


def export_graph(db: Path, out: Path) -> dict[str, Any]:
    """Counts of what was written. Nothing is written before everything is read."""
    found, version = _read(db)
    graph = found.graph
    assert graph.poses is not None
    assert graph.tags is not None
    comments = [f"map version {version}", *found.names]
    try:
        with out.open("w", encoding="utf-8") as file:
            write_g2o(file, graph, comments)
    except OSError as error:
        raise DataError(f"{out}: cannot be written: {error.strerror}") from None
    return {
        "out": str(out),
        "tags": len(graph.tags.id),
        "poses": len(graph.poses.id),
        "steps": len(graph.steps),
        "sightings": len(graph.points),
        "skipped": found.skipped,
    }


def _read(db: Path) -> tuple[MapGraph, int]:
    """Again when a service makes a new version meanwhile."""
    with SiteStore.open(db, read_only=True) as store:
        for _ in range(ATTEMPTS):
            version = store.latest_version()
            if version is None:
                raise StoreError(f"{db}: no map yet, expected a site whose map was solved")
            summary = store.summary(version.version) or {}
            scale = {"range": summary.get("scale"), "stereo": summary.get("stereo_scale")}
            known = {name: float(value) for name, value in scale.items() if value is not None}
            found = graph_of_map(db, _sessions(store), store.tags(version.version), known)
            if store.latest_version() == version:
                return found, version.version
    raise StoreError(f"{db}: the map changed during each of {ATTEMPTS} exports; try again")


def _sessions(store: SiteStore) -> list[MappedSession]:
    hellos = {(row.robot, row.session): row.hello for row in store.sessions()}
    sessions = []
    for poses in store.poses():
        hello = hellos[poses.robot, poses.session]
        if hello is not None:
            keyframes = store.keyframes_of(poses.robot, poses.session)
            order = poses.seqs.argsort()
            sessions.append(MappedSession(hello, poses.seqs[order], poses.T[order], keyframes))
    return sessions
