"""What the service made of it, read from its database."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fleet.evaluation.estimate import Estimate, TagEstimate, TrackEstimate
from tagmap.conventions import POSE_DOF, Array, Kind
from tagmap.geometry.covariance import unpack_upper
from tagmap.records import Tag
from tagmap.records.arrays import covariance
from tagmap.store import SiteStore
from tagmap.store.rows import SessionPoses


@dataclass(frozen=True, slots=True)
class Results:
    """`keyframes`: stored, by robot number; `summary`: of the solve behind the newest version."""

    estimate: Estimate
    keyframes: dict[int, int]
    tags_total: int
    version: int | None
    gauge: str | None
    summary: dict[str, Any]

    @property
    def keyframes_stored(self) -> int:
        return sum(self.keyframes.values())


def read_results(db: Path, kind: Kind) -> Results:
    """The newest map version. Raises StoreError."""
    with SiteStore.open(db, read_only=True) as store:
        rows = store.robots()
        latest = store.latest_version()
        summary = store.summary(latest.version) if latest else None
        tags, poses = store.tags(), store.poses()
    numbers = {row.robot: row.number for row in rows if row.number is not None}
    by_robot: dict[int, list[SessionPoses]] = {}
    for session in poses:
        by_robot.setdefault(numbers[session.robot], []).append(session)
    return Results(
        estimate=Estimate(
            kind,
            {tag.tag: _tag(tag) for tag in tags if tag.p_m is not None},
            {number: _track(kind, sessions) for number, sessions in by_robot.items()},
        ),
        keyframes={numbers[row.robot]: row.keyframes for row in rows if row.robot in numbers},
        tags_total=len(tags),
        version=latest.version if latest else None,
        gauge=latest.gauge if latest else None,
        summary=summary or {},
    )


def _tag(tag: Tag) -> TagEstimate:
    return TagEstimate(np.array(tag.p_m), None if tag.cov is None else covariance(tag.cov))


def _track(kind: Kind, sessions: list[SessionPoses]) -> TrackEstimate:
    """All sessions of one robot in time order."""
    t_ns = np.concatenate([s.t_ns for s in sessions])
    order = np.argsort(t_ns, kind="stable")
    T = np.concatenate([s.T for s in sessions])
    cov = np.concatenate([_covariances(kind, s) for s in sessions])
    return TrackEstimate(t_ns[order], T[order], cov[order])


def _covariances(kind: Kind, poses: SessionPoses) -> Array:
    """(N, dof, dof), NaN where there is none."""
    dof = POSE_DOF[kind]
    if poses.cov is None:
        return np.full((len(poses.seqs), dof, dof), np.nan)
    return unpack_upper(poses.cov, dof)
