"""A map with the keyframes it was made from, as a graph for other programs.

Graphs of other programs know landmarks as points. What is seen in pixels or as range and bearing
becomes the point it is the image of, with its covariance carried along to first order.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Form, Index, Kind
from tagmap.exchange.graph import Fixed, Graph, PointEdges, StepEdges, Vertices
from tagmap.exchange.graph_numbers import inverse
from tagmap.geometry import measurement, se2, se3
from tagmap.geometry.covariance import unpack_upper
from tagmap.records import Hello, Keyframe, Sighting, Tag
from tagmap.records import arrays as convert

SCALES: dict[Form, str] = {"range_bearing": "range", "point_cam_m": "range", "stereo_px": "stereo"}
"""Which of the scales that a site shares a form has."""


@dataclass(frozen=True, slots=True)
class MappedSession:
    """Poses T (n, D, D) of the keyframes `seqs` (n,) on the map, and all keyframes, by seq."""

    hello: Hello
    seqs: Index
    T: Array
    keyframes: Sequence[Keyframe]


@dataclass(frozen=True, slots=True)
class MapGraph:
    """names: what the graph's numbers stand for. skipped: sightings that give no point."""

    graph: Graph
    names: tuple[str, ...]
    skipped: int


@dataclass(frozen=True, slots=True)
class _Seen:
    pose: int
    tag: int
    p_base: Array
    cov: Array


def graph_of_map(
    path: Path, sessions: Sequence[MappedSession], tags: Sequence[Tag], scale: Mapping[str, float]
) -> MapGraph:
    """Poses are numbered session by session, then come the tags that have a position.

    scale: the map's common scales, "range" and "stereo", where it has them. The first pose is
    fixed. All sightings are in it, those too that the map takes for wrong.
    """
    kind: Kind = sessions[0].hello.kind if sessions else "spatial"
    n_poses = sum(len(session.seqs) for session in sessions)
    mapped = [tag for tag in tags if tag.p_m is not None]
    number_of = {tag.tag: n_poses + i for i, tag in enumerate(mapped)}
    names, seen, skipped = [], list[_Seen](), 0
    steps: list[tuple[int, Keyframe]] = []
    first = 0
    for session in sessions:
        last = first + len(session.seqs) - 1
        names.append(f"{first}..{last}: robot {session.hello.robot}, {session.hello.session}")
        poses = {int(seq): first + i for i, seq in enumerate(session.seqs)}
        kept = [frame for frame in session.keyframes if frame.seq in poses]
        steps += [
            (poses[frame.seq - 1], frame)
            for frame in kept
            if frame.odom is not None and frame.seq - 1 in poses
        ]
        found, none = _points(session.hello, kept, poses, number_of, scale)
        seen, skipped, first = seen + found, skipped + none, last + 1
    names += [f"{number}: tag {tag}" for tag, number in number_of.items()]
    T = np.concatenate([np.zeros((0, TAG_DOF[kind] + 1, TAG_DOF[kind] + 1)), *_poses(sessions)])
    graph = Graph(
        path=path,
        kind=kind,
        steps=_steps(kind, steps),
        points=_edges(kind, seen),
        T_base_cam=np.eye(TAG_DOF[kind] + 1)[None],
        poses=Vertices(np.arange(n_poses), T, _no_lines(n_poses)),
        tags=_vertices(kind, mapped, n_poses),
        fixed=Fixed(np.arange(min(n_poses, 1)), _no_lines(min(n_poses, 1))),
    )
    return MapGraph(graph, tuple(names), skipped)


def _poses(sessions: Sequence[MappedSession]) -> list[Array]:
    return [session.T for session in sessions]


def _vertices(kind: Kind, mapped: Sequence[Tag], n_poses: int) -> Vertices:
    p = np.array([tag.p_m for tag in mapped], dtype=np.float64).reshape(-1, TAG_DOF[kind])
    return Vertices(n_poses + np.arange(len(mapped)), p, _no_lines(len(mapped)))


def _steps(kind: Kind, steps: Sequence[tuple[int, Keyframe]]) -> StepEdges:
    odometry = [frame.odom for _, frame in steps if frame.odom is not None]
    a = np.array([number for number, _ in steps], dtype=np.int64)
    dof = POSE_DOF[kind]
    upper = np.array([odom.cov for odom in odometry], dtype=np.float64)
    cov = unpack_upper(upper.reshape(-1, dof * (dof + 1) // 2), dof)
    T = convert.matrices(kind, [odom.T_prev_cur for odom in odometry])
    return StepEdges(a, a + 1, T, inverse(cov), _no_lines(len(a)))


def _edges(kind: Kind, seen: Sequence[_Seen]) -> PointEdges:
    d, k = TAG_DOF[kind], len(seen)
    return PointEdges(
        pose=np.array([one.pose for one in seen], dtype=np.int64),
        tag=np.array([one.tag for one in seen], dtype=np.int64),
        p_cam=np.array([one.p_base for one in seen]).reshape(k, d),
        information=inverse(np.array([one.cov for one in seen]).reshape(k, d, d)),
        offset=_no_lines(k),
        line=_no_lines(k),
    )


def _points(
    hello: Hello,
    frames: Sequence[Keyframe],
    poses: Mapping[int, int],
    number_of: Mapping[str, int],
    scale: Mapping[str, float],
) -> tuple[list[_Seen], int]:
    """Sightings of tags on the map as points in base, and how many give none."""
    rig = None if hello.rig is None else convert.stereo_rig(hello.rig)
    group = se3 if hello.kind == "spatial" else se2
    d, skipped = TAG_DOF[hello.kind], 0
    seen = []
    for frame in frames:
        T_base_cam = convert.matrix(frame.T_base_cam)
        R = T_base_cam[:d, :d]
        for sighting in (one for one in frame.sightings if one.tag in number_of):
            z, cov = np.array(sighting.z.values)[None], convert.covariance(sighting.z.cov)[None]
            given = measurement.to_point(sighting.z.form, hello.kind, z, cov, rig)
            if given is None or not np.isfinite(given[0].sum() + given[1].sum()):
                skipped += 1
                continue
            s = _scale(hello, sighting, scale)
            p_base = group.act(T_base_cam, given[0][0] / s)
            cov_base = R @ given[1][0] @ R.T / s**2
            seen.append(_Seen(poses[frame.seq], number_of[sighting.tag], p_base, cov_base))
    return seen, skipped


def _scale(hello: Hello, sighting: Sighting, scale: Mapping[str, float]) -> float:
    """By how much the robot's sensor stretches what it sees, as the map has found."""
    name = SCALES.get(sighting.z.form)
    sigma = {"range": hello.range_scale_sigma, "stereo": hello.stereo_scale_sigma}
    if name is None or sigma[name] is None:
        return 1.0
    return scale.get(name, 1.0)


def _no_lines(n: int) -> Index:
    """Nothing here was read from a file."""
    return np.zeros(n, dtype=np.int64)
