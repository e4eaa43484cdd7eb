"""Graphs in the g2o format: SE2 with XY, or SE3 with TRACKXYZ.

Format: https://github.com/RainerKuemmerle/g2o/wiki/File-Format and the `read` functions of g2o's
slam2d and slam3d types. The information of SE3 edges is taken in the order (v, omega) with omega a
rotation vector, as GTSAM and Ceres do.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TextIO

import numpy as np

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Index, Kind
from tagmap.exchange.graph import (
    Fixed,
    Graph,
    PointEdges,
    StepEdges,
    Vertices,
    refuse,
)
from tagmap.exchange.graph_numbers import (
    POSE_NUMBERS,
    empty,
    numbers_of,
    positive_definite,
    transforms,
)
from tagmap.exchange.graph_text import Layout, Table, read_tables
from tagmap.geometry.covariance import pack_upper

POSE: dict[Kind, str] = {"planar": "VERTEX_SE2", "spatial": "VERTEX_SE3:QUAT"}
TAG: dict[Kind, str] = {"planar": "VERTEX_XY", "spatial": "VERTEX_TRACKXYZ"}
STEP: dict[Kind, str] = {"planar": "EDGE_SE2", "spatial": "EDGE_SE3:QUAT"}
OFFSET: dict[Kind, str] = {"planar": "PARAMS_SE2OFFSET", "spatial": "PARAMS_SE3OFFSET"}
POINT = "EDGE_SE2_XY"
POINT_OFFSET: dict[Kind, str] = {
    "planar": "EDGE_SE2_POINTXY_OFFSET",
    "spatial": "EDGE_SE3_TRACKXYZ",
}
KINDS: tuple[Kind, Kind] = ("planar", "spatial")


def _triangle(n: int) -> int:
    return n * (n + 1) // 2


def _layouts() -> dict[str, Layout]:
    layouts = {"FIX": Layout(None, 0), POINT: Layout(2, 2 + _triangle(2))}
    for kind in KINDS:
        pose, d = POSE_NUMBERS[kind], TAG_DOF[kind]
        layouts |= {
            POSE[kind]: Layout(1, pose),
            TAG[kind]: Layout(1, d),
            STEP[kind]: Layout(2, pose + _triangle(POSE_DOF[kind])),
            OFFSET[kind]: Layout(1, pose),
            POINT_OFFSET[kind]: Layout(3, d + _triangle(d)),
        }
    return layouts


LAYOUTS = _layouts()


def read_g2o(path: Path) -> Graph:
    """DataError names the file and the line of the first thing that is wrong."""
    tables = read_tables(path, LAYOUTS)
    kind = _kind(tables)
    steps, fixed = tables[STEP[kind]], tables["FIX"]
    offsets = tables[OFFSET[kind]]
    T_base_cam = np.concatenate([np.eye(TAG_DOF[kind] + 1)[None], transforms(kind, offsets)])
    has_values = len(tables[POSE[kind]]) + len(tables[TAG[kind]]) > 0
    return Graph(
        path=path,
        kind=kind,
        steps=StepEdges(
            steps.ids[:, 0],
            steps.ids[:, 1],
            transforms(kind, steps),
            positive_definite(steps, POSE_NUMBERS[kind], POSE_DOF[kind], "information"),
            steps.line,
        ),
        points=_points(kind, tables, offsets),
        T_base_cam=T_base_cam,
        poses=_poses(kind, tables[POSE[kind]]) if has_values else None,
        tags=_tags(tables[TAG[kind]]) if has_values else None,
        fixed=Fixed(fixed.ids[:, 0], fixed.line),
    )


def _poses(kind: Kind, table: Table) -> Vertices:
    return Vertices(table.ids[:, 0], transforms(kind, table), table.line)


def _tags(table: Table) -> Vertices:
    return Vertices(table.ids[:, 0], table.numbers, table.line)


def _kind(tables: dict[str, Table]) -> Kind:
    """Planar or spatial, as the first line says that tells."""
    of: dict[Kind, list[str]] = {
        kind: [POSE[kind], TAG[kind], STEP[kind], OFFSET[kind], POINT_OFFSET[kind]]
        for kind in KINDS
    }
    of["planar"].append(POINT)
    first: dict[Kind, tuple[int, str]] = {}
    for kind in KINDS:
        lines = [(int(tables[name].line[0]), name) for name in of[kind] if len(tables[name])]
        if lines:
            first[kind] = min(lines)
    if len(first) == 2:
        wanted, other = sorted(KINDS, key=lambda kind: first[kind])
        line, name = first[other]
        refuse(tables[name].path, line, f"{name} in a {wanted} graph", f"a {wanted} line")
    return next(iter(first), "spatial")


def _points(kind: Kind, tables: dict[str, Table], offsets: Table) -> PointEdges:
    """Landmark edges without offset (number 0) and with one."""
    with_offset = tables[POINT_OFFSET[kind]]
    parts = [_point_part(kind, with_offset, 1 + _offset_numbers(with_offset, offsets))]
    if kind == "planar":
        plain = tables[POINT]
        parts.insert(0, _point_part(kind, plain, np.zeros(len(plain), dtype=np.int64)))
    fields = ("pose", "tag", "p_cam", "information", "offset", "line")
    whole = {name: np.concatenate([getattr(part, name) for part in parts]) for name in fields}
    order = np.argsort(whole["line"], kind="stable")
    return PointEdges(**{name: values[order] for name, values in whole.items()})


def _point_part(kind: Kind, table: Table, offset: Index) -> PointEdges:
    d = TAG_DOF[kind]
    return PointEdges(
        table.ids[:, 0],
        table.ids[:, 1],
        table.numbers[:, :d],
        positive_definite(table, d, d, "information"),
        offset,
        table.line,
    )


def _offset_numbers(edges: Table, offsets: Table) -> Index:
    """Which of the offsets each edge names."""
    known: dict[int, int] = {}
    for number, (id_, line) in enumerate(zip(offsets.ids[:, 0], offsets.line, strict=True)):
        if known.setdefault(int(id_), number) != number:
            first = int(offsets.line[known[int(id_)]])
            refuse(offsets.path, int(line), f"parameter {id_} again", f"only that of line {first}")
    for id_, line in zip(edges.ids[:, 2], edges.line, strict=True):
        if int(id_) not in known:
            refuse(edges.path, int(line), f"parameter {id_}", "one that the file has")
    numbers = [known[int(id_)] for id_ in edges.ids[:, 2]]
    return np.array(numbers, dtype=np.int64) if numbers else empty()


def write_g2o(file: TextIO, graph: Graph, comments: Iterable[str] = ()) -> None:
    """The graph with its vertices and edges; numbers keep all their digits.

    Landmark edges are written in base, as GTSAM reads no offset but the identity. What is fixed and
    the comments come last: GTSAM's planar reader stops at them.
    """
    assert graph.poses is not None
    assert graph.tags is not None
    kind, steps = graph.kind, graph.steps
    points = _in_base(graph)
    pose_and_tag = [points.pose, points.tag]
    if kind == "spatial":
        identity = np.eye(4)[None]
        _write(file, OFFSET[kind], np.zeros((1, 1), dtype=np.int64), numbers_of(kind, identity))
        pose_and_tag.append(np.zeros_like(points.pose))
    _write(file, POSE[kind], graph.poses.id[:, None], numbers_of(kind, graph.poses.value))
    _write(file, TAG[kind], graph.tags.id[:, None], graph.tags.value)
    step_numbers = np.hstack([numbers_of(kind, steps.T), pack_upper(steps.information)])
    _write(file, STEP[kind], np.stack([steps.a, steps.b], axis=1), step_numbers)
    point_numbers = np.hstack([points.p_cam, pack_upper(points.information)])
    name = POINT if kind == "planar" else POINT_OFFSET[kind]
    _write(file, name, np.stack(pose_and_tag, axis=1), point_numbers)
    _write(file, "FIX", graph.fixed.id[:, None], np.zeros((len(graph.fixed.id), 0)))
    file.writelines(f"# {comment}\n" for comment in comments)


def _in_base(graph: Graph) -> PointEdges:
    """The same landmark edges as seen from base: cam without offset."""
    points, d = graph.points, TAG_DOF[graph.kind]
    T = graph.T_base_cam[points.offset]
    R, t = T[:, :d, :d], T[:, :d, d]
    p_base = (R @ points.p_cam[:, :, None])[:, :, 0] + t
    information = R @ points.information @ np.swapaxes(R, 1, 2)
    return replace(points, p_cam=p_base, information=information)


def _write(file: TextIO, name: str, ids: Index, numbers: Array) -> None:
    for left, right in zip(ids.tolist(), numbers.tolist(), strict=True):
        file.write(" ".join([name, *map(str, left), *map(repr, right)]) + "\n")
