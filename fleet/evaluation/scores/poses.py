"""Robots' poses against where they truly were: those of the map's solution, and the live ones."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fleet.evaluation import metrics
from fleet.evaluation.scores.evidence import Evidence
from fleet.evaluation.truth import TrueTrack, at
from tagmap.conventions import Array, Index
from tagmap.errors import RecordRefused
from tagmap.records import Pose, decode
from tagmap.records.arrays import matrix
from tagmap.store import SessionPoses

IN_VIEW = 4
STALE_NS = 3_000_000_000
STEP_NS = 500_000_000
OVER_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Errors of all solved poses: (N,) m and (N,) rad, and of motions over 1 s."""

    error_m: Array
    heading_rad: Array
    rpe_m: Array


@dataclass(frozen=True, slots=True)
class Live:
    """Live poses of one robot in order of time (of the world): `error_m` NaN while lost;
    in_view: named tags in the keyframe that it is of; heard_ns: when it was published."""

    t_ns: Index
    error_m: Array
    in_view: Index
    heard_ns: Index


def smoothed(evidence: Evidence, T_truth_map: Array) -> Smoothed:
    parts = [_solved(evidence, T_truth_map, poses) for poses in evidence.poses]
    empty = np.zeros(0)
    if not parts:
        return Smoothed(empty, empty, empty)
    return Smoothed(*(np.concatenate([part[k] for part in parts]) for k in range(3)))


def _solved(
    evidence: Evidence, T_truth_map: Array, poses: SessionPoses
) -> tuple[Array, Array, Array]:
    times = [evidence.world_ns(poses.robot, int(t), poses.session) for t in poses.t_ns]
    world_ns = np.array(times, dtype=np.int64)
    T_true, known = at("spatial", evidence.tracks[poses.robot], world_ns)
    T_est = T_truth_map @ poses.T[known]
    moved_m, _ = metrics.relative_errors("spatial", world_ns[known], T_est, T_true, OVER_NS)
    return metrics.position_errors(T_est, T_true), _headings(T_est, T_true), moved_m


def live(evidence: Evidence, T_truth_of: Mapping[int, Array | None]) -> dict[str, Live]:
    """T_truth_of: of each map version, how it lies in the truth; None: it cannot be said."""
    views = {
        (keyframe.robot, keyframe.session, keyframe.t_ns): len(keyframe.sightings)
        for keyframe in evidence.keyframes
    }
    given: dict[str, list[_Given]] = {}
    for heard_ns, robot, pose in _published(evidence):
        t_ns = evidence.world_ns(robot, pose.t_ns, pose.robot_session)
        view = views.get((robot, pose.robot_session, pose.t_ns), 0)
        T = T_truth_of.get(pose.map_version or 0)
        given.setdefault(robot, []).append(_Given(t_ns, heard_ns, view, T, pose))
    return {robot: _judged(evidence.tracks[robot], rows) for robot, rows in given.items()}


@dataclass(frozen=True, slots=True)
class _Given:
    """A pose as it was published, and how the map that it is on lies in the truth."""

    t_ns: int
    heard_ns: int
    in_view: int
    T_truth_map: Array | None
    pose: Pose


def _published(evidence: Evidence) -> list[tuple[int, str, Pose]]:
    """Live poses of the service."""
    found = []
    robots = {evidence.keys.pose(robot): robot for robot in evidence.world.robots}
    for heard in evidence.heard:
        robot = robots.get(heard.key)
        if robot is None:
            continue
        try:
            found.append((heard.t_ns, robot, decode(Pose, heard.payload)))
        except RecordRefused:
            continue
    return found


def _judged(track: TrueTrack, rows: list[_Given]) -> Live:
    rows = sorted(rows, key=lambda row: (row.t_ns, row.heard_ns))
    t_ns = np.array([row.t_ns for row in rows], dtype=np.int64)
    T_true, known = at("spatial", track, t_ns)
    where = dict(zip(known.tolist(), T_true, strict=True))
    error_m = np.full(len(rows), np.nan)
    chosen = [
        (k, row.T_truth_map @ matrix(row.pose.T_map_base), where[k])
        for k, row in enumerate(rows)
        if row.pose.T_map_base is not None and row.T_truth_map is not None and k in where
    ]
    if chosen:
        index, T, truth = zip(*chosen, strict=True)
        error_m[list(index)] = metrics.position_errors(np.array(T), np.array(truth))
    return Live(
        t_ns,
        error_m,
        np.array([row.in_view for row in rows]),
        np.array([row.heard_ns for row in rows], dtype=np.int64),
    )


def p95_m(tracks: Mapping[str, Live]) -> float | None:
    """Of live poses with enough tags in view."""
    chosen = [track.error_m[track.in_view >= IN_VIEW] for track in tracks.values()]
    errors = np.concatenate(chosen) if chosen else np.zeros(0)
    errors = errors[np.isfinite(errors)]
    return float(np.percentile(errors, 95)) if len(errors) else None


def availability(evidence: Evidence, tracks: Mapping[str, Live]) -> float:
    """Share of the time in which a robot's latest pose is neither lost nor old."""
    world = evidence.world
    grid = np.arange(world.start_ns, world.end_ns, STEP_NS)
    shares = []
    for name in world.robots:
        track = tracks.get(name)
        if track is None:
            shares.append(0.0)
            continue
        order = np.argsort(track.heard_ns, kind="stable")
        k = np.searchsorted(track.heard_ns[order], grid, side="right") - 1
        there = np.isfinite(track.error_m[order][k]) & (grid - track.t_ns[order][k] <= STALE_NS)
        shares.append(float(((k >= 0) & there).mean()))
    return float(np.mean(shares))


def first_fix_s(evidence: Evidence, tracks: Mapping[str, Live]) -> float | None:
    """When the last of the robots knew for the first time where it is; None: one never did."""
    times = []
    for name in evidence.world.robots:
        track = tracks.get(name)
        if track is None or not np.isfinite(track.error_m).any():
            return None
        first_ns = int(track.heard_ns[np.isfinite(track.error_m)].min())
        times.append(1e-9 * (first_ns - evidence.world.start_ns))
    return max(times)


def _headings(T: Array, T_true: Array) -> Array:
    """(N,) rad, of the x axis on the floor."""
    yaw = np.arctan2(T[:, 1, 0], T[:, 0, 0]) - np.arctan2(T_true[:, 1, 0], T_true[:, 0, 0])
    return np.abs((yaw + np.pi) % (2.0 * np.pi) - np.pi)
