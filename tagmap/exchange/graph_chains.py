"""The poses of a graph in the order of its chains, as the joint problem wants them."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Index
from tagmap.exchange.graph import Graph, refuse


@dataclass(frozen=True, slots=True)
class Chains:
    """order (N,): ids of all poses, chain after chain; chain (N,): its number of each of them.

    edge, first (K,): steps of the graph in the order of the poses they begin at; reverse (K,):
    True where the step is given from the later pose to the earlier.
    """

    order: Index
    chain: Index
    edge: Index
    first: Index
    reverse: Index


def chains_of(graph: Graph, ids: Index) -> Chains:
    """Every pose has at most two neighbours and no chain is closed: DataError names what is more.

    A chain begins at the end that comes first in `ids`.
    """
    neighbours = _neighbours(graph, ids)
    order: list[int] = []
    chain: list[int] = []
    edges: list[int] = []
    first: list[int] = []
    done: set[int] = set()
    for end in ids.tolist():
        if end in done or len(neighbours[end]) == 2:
            continue
        number = chain[-1] + 1 if chain else 0
        here: int | None = end
        while here is not None:
            done.add(here)
            order.append(here)
            chain.append(number)
            onward = [(to, edge) for to, edge in neighbours[here] if to not in done]
            here = None
            if onward:
                here, edge = onward[0]
                edges.append(edge)
                first.append(len(order) - 1)
    edge_ = np.array(edges, dtype=np.int64)
    order_, first_ = np.array(order, dtype=np.int64), np.array(first, dtype=np.int64)
    reverse = graph.steps.a[edge_] != order_[first_]
    return Chains(order_, np.array(chain, dtype=np.int64), edge_, first_, reverse)


def _neighbours(graph: Graph, ids: Index) -> dict[int, list[tuple[int, int]]]:
    """Of each pose, the poses next to it and the edges that say so: no more than two."""
    neighbours: dict[int, list[tuple[int, int]]] = {id_: [] for id_ in ids.tolist()}
    other_end = {id_: id_ for id_ in ids.tolist()}
    for edge, (a, b) in enumerate(zip(graph.steps.a.tolist(), graph.steps.b.tolist(), strict=True)):
        for id_ in (a, b):
            if len(neighbours[id_]) == 2:
                (p, _), (q, _) = neighbours[id_]
                _not_a_chain(graph, edge, f"pose {id_} is already joined to {p} and {q}")
        if other_end[a] == b or a == b:
            _not_a_chain(graph, edge, f"{a} and {b} are already joined")
        neighbours[a].append((b, edge))
        neighbours[b].append((a, edge))
        ends = other_end[a], other_end[b]
        other_end[ends[0]], other_end[ends[1]] = ends[1], ends[0]
    return neighbours


def _not_a_chain(graph: Graph, edge: int, why: str) -> None:
    steps = graph.steps
    got = f"a step from {steps.a[edge]} to {steps.b[edge]}, but {why}"
    refuse(graph.path, int(steps.line[edge]), got, "chains of poses without branches or loops")
