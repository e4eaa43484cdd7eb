"""A pose graph as files hold it: steps between poses, and landmarks seen from poses.

Landmarks are the tags of other programs. Ids are the file's; poses and landmarks share one space.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from tagmap.conventions import Array, Index, Kind
from tagmap.errors import DataError


@dataclass(frozen=True, slots=True)
class StepEdges:
    """Steps: ids a, b (K,); T_a_b (K, D, D); information (K, dof, dof) of their errors in b."""

    a: Index
    b: Index
    T: Array
    information: Array
    line: Index

    def __len__(self) -> int:
        return len(self.a)


@dataclass(frozen=True, slots=True)
class PointEdges:
    """Landmarks seen: ids of pose and tag (K,); p_cam (K, d) m, information (K, d, d).

    offset (K,): which of the graph's offsets cam has in base.
    """

    pose: Index
    tag: Index
    p_cam: Array
    information: Array
    offset: Index
    line: Index

    def __len__(self) -> int:
        return len(self.pose)


@dataclass(frozen=True, slots=True)
class Vertices:
    """Ids (N,), values: T (N, D, D) of poses or p (N, d) of tags."""

    id: Index
    value: Array
    line: Index


@dataclass(frozen=True, slots=True)
class Fixed:
    """Ids (K,) that the file wants to stay where they are."""

    id: Index
    line: Index


@dataclass(frozen=True, slots=True)
class Graph:
    """One file. T_base_cam (U, D, D) are the offsets of PointEdges.

    poses, tags: start values, in the order of the file; both None where the file has none.
    """

    path: Path
    kind: Kind
    steps: StepEdges
    points: PointEdges
    T_base_cam: Array
    poses: Vertices | None
    tags: Vertices | None
    fixed: Fixed


def refuse(path: Path, line: int, got: str, expected: str) -> NoReturn:
    """What every reader says of what it does not take."""
    raise DataError(f"{path}: line {line}: {got}, expected {expected}")


def ids_in_order(graph: Graph) -> tuple[Index, Index]:
    """Ids of all poses and of all tags: in the order of their vertices, else of their edges."""
    if graph.poses is not None and graph.tags is not None:
        return graph.poses.id, graph.tags.id
    ends = np.stack([graph.steps.a, graph.steps.b], axis=1).ravel()
    return _first_seen(np.concatenate([ends, graph.points.pose])), _first_seen(graph.points.tag)


def _first_seen(ids: Index) -> Index:
    distinct, first = np.unique(ids, return_index=True)
    seen: Index = distinct[np.argsort(first)]
    return seen
