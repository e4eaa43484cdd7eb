"""A graph as the joint problem: steps are odometry, landmarks are tags seen as points."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from tagmap.conventions import TAG_DOF, Array, Index
from tagmap.errors import DataError
from tagmap.estimation.problem import Odometry, Problem, Sightings, State, Surveyed, lie
from tagmap.exchange.graph import Fixed, Graph, Vertices, ids_in_order, refuse
from tagmap.exchange.graph_chains import Chains, chains_of
from tagmap.exchange.graph_numbers import empty


@dataclass(frozen=True, slots=True)
class Posed:
    """The problem; ids of its poses (N,) and tags (M,); chain (N,): the chain of each pose.

    given: the start values of the file, if it has any. held: the pose that stays where it is.
    """

    problem: Problem
    poses: Index
    tags: Index
    chain: Index
    given: State | None
    held: int


def problem_of(graph: Graph) -> Posed:
    """DataError names the line of the first edge or vertex that has no place in the problem."""
    poses, tags = ids_in_order(graph)
    _check_ids(graph, poses, tags)
    chains = chains_of(graph, poses)
    pose, tag = _numbers(chains.order, graph.points.pose), _numbers(tags, graph.points.tag)
    _check_one_part(graph, chains, pose, tag, tags)
    d = TAG_DOF[graph.kind]
    problem = Problem(
        kind=graph.kind,
        n_poses=len(chains.order),
        n_tags=len(tags),
        odometry=_odometry(graph, chains),
        sightings=(_sightings(graph, pose, tag),),
        surveyed=Surveyed(empty(), np.zeros((0, d)), np.zeros((0, d, d))),
    )
    given = None
    if graph.poses is not None and graph.tags is not None:
        T = graph.poses.value[_numbers(graph.poses.id, chains.order)]
        given = State(T, graph.tags.value, np.zeros(0))
    return Posed(problem, chains.order, tags, chains.chain, given, _held(graph, chains))


def solved_graph(graph: Graph, posed: Posed, state: State) -> Graph:
    """The same edges with the vertices of `state`; a vertex is in the line it was in."""
    line = np.zeros(len(posed.poses), dtype=np.int64)
    tag_line = np.zeros(len(posed.tags), dtype=np.int64)
    fixed = graph.fixed
    if not len(fixed.id):
        fixed = Fixed(posed.poses[[posed.held]], np.zeros(1, dtype=np.int64))
    return replace(
        graph,
        poses=Vertices(posed.poses, state.T, line),
        tags=Vertices(posed.tags, state.p, tag_line),
        fixed=fixed,
    )


def _numbers(ids: Index, wanted: Index) -> Index:
    """The place in `ids` of each of `wanted`, all of which are there."""
    order = np.argsort(ids)
    places: Index = order[np.searchsorted(ids, wanted, sorter=order)]
    return places


def _check_ids(graph: Graph, poses: Index, tags: Index) -> None:
    if not len(poses):
        raise DataError(f"{graph.path}: no pose, expected at least one")
    steps, points = graph.steps, graph.points
    if graph.poses is not None and graph.tags is not None:
        _check_once(graph, graph.poses, graph.tags)
    else:
        both = np.flatnonzero(np.isin(points.tag, poses))
        if len(both):
            got = f"landmark {points.tag[both[0]]}, which is a pose elsewhere"
            refuse(graph.path, int(points.line[both[0]]), got, "an id of its own")
    for used, line, known, what in (
        (steps.a, steps.line, poses, "pose"),
        (steps.b, steps.line, poses, "pose"),
        (points.pose, points.line, poses, "pose"),
        (points.tag, points.line, tags, "landmark"),
        (graph.fixed.id, graph.fixed.line, poses, "pose"),
    ):
        unknown = np.flatnonzero(~np.isin(used, known))
        if len(unknown):
            got = f"{what} {used[unknown[0]]} without a vertex"
            refuse(graph.path, int(line[unknown[0]]), got, f"a {what} that the file has")
    if len(graph.fixed.id) > 1:
        got = f"a second fixed vertex, {graph.fixed.id[1]}"
        refuse(graph.path, int(graph.fixed.line[1]), got, "one fixed pose at most")


def _check_once(graph: Graph, poses: Vertices, tags: Vertices) -> None:
    ids, line = np.concatenate([poses.id, tags.id]), np.concatenate([poses.line, tags.line])
    order = np.argsort(line, kind="stable")
    _, first = np.unique(ids[order], return_index=True)
    again = np.setdiff1d(np.arange(len(ids)), first)
    if len(again):
        got = f"vertex {ids[order][again[0]]} again"
        refuse(graph.path, int(line[order][again[0]]), got, "one line per vertex")


def _check_one_part(graph: Graph, chains: Chains, pose: Index, tag: Index, tags: Index) -> None:
    n, m = len(chains.order), len(tags)
    a = np.concatenate([chains.first, pose])
    b = np.concatenate([chains.first + 1, n + tag])
    joined = sparse.coo_matrix((np.ones(len(a)), (a, b)), (n + m, n + m))
    parts, part = connected_components(joined, directed=False)
    if parts == 1:
        return
    apart = int(np.flatnonzero(part != part[0])[0])
    name = f"pose {chains.order[apart]}" if apart < n else f"landmark {tags[apart - n]}"
    got = f"{name}, which no edges join to pose {chains.order[0]} ({parts} parts)"
    refuse(graph.path, _line_of(graph, chains, tags, apart), got, "a graph in one part")


def _line_of(graph: Graph, chains: Chains, tags: Index, number: int) -> int:
    """Where a pose, or a landmark numbered after all poses, is first named."""
    n = len(chains.order)
    id_ = chains.order[number] if number < n else tags[number - n]
    places = [
        (vertices.id, vertices.line)
        for vertices in (graph.poses, graph.tags)
        if vertices is not None
    ]
    steps, points = graph.steps, graph.points
    places += [(steps.a, steps.line), (steps.b, steps.line)]
    places += [(points.pose, points.line), (points.tag, points.line)]
    return min(int(line) for ids, lines in places for line in lines[ids == id_])


def _odometry(graph: Graph, chains: Chains) -> Odometry:
    """Steps forwards along the chains.

    What is given backwards has the error of its inverse, seen from the other end:
    log(Z X^-1) = -Ad(Z) log(Z^-1 X) for a step X measured as Z.
    """
    group = lie(graph.kind)
    T, information = graph.steps.T[chains.edge], graph.steps.information[chains.edge]
    back = np.flatnonzero(chains.reverse)
    if len(back):
        inverse = group.inverse(T[back])
        Ad = group.adjoint(inverse)
        information[back] = np.swapaxes(Ad, -1, -2) @ information[back] @ Ad
        T[back] = inverse
    return Odometry(chains.first, T, lower_root(information))


def _sightings(graph: Graph, pose: Index, tag: Index) -> Sightings:
    order = np.argsort(pose, kind="stable")
    points = graph.points
    T_cam_base = lie(graph.kind).inverse(graph.T_base_cam)
    return Sightings(
        form="point_cam_m",
        rig=None,
        pose=pose[order],
        tag=tag[order],
        z=points.p_cam[order],
        whiten=lower_root(points.information[order]),
        T_cam_base=T_cam_base[points.offset[order]],
    )


def lower_root(information: Array) -> Array:
    """W (K, n, n), lower triangular, with W^T W = information."""
    turned = np.linalg.cholesky(information[:, ::-1, ::-1])
    root: Array = np.swapaxes(turned, -1, -2)[:, ::-1, ::-1]
    return np.ascontiguousarray(root)


def _held(graph: Graph, chains: Chains) -> int:
    if not len(graph.fixed.id):
        return 0
    return int(np.flatnonzero(chains.order == graph.fixed.id[0])[0])
