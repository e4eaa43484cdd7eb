"""What `tagmap map solve FILE` does: read, solve, write, and say what it took."""

import resource
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tagmap.errors import DataError
from tagmap.exchange.g2o import write_g2o
from tagmap.exchange.graph import Graph
from tagmap.exchange.graph_file import read_graph
from tagmap.exchange.graph_problem import problem_of, solved_graph
from tagmap.exchange.graph_solve import SolvedGraph, solve_posed

STATUS = Path("/proc/self/status")


@dataclass(frozen=True, slots=True)
class Wanted:
    """start: "file", "nothing", or None for the file's values if it has any."""

    path: Path
    out: Path | None
    start: str | None
    robust: bool


def solve_file(wanted: Wanted, began_s: float) -> tuple[dict[str, Any], int]:
    """The summary, and how many landmark edges were rejected; `began_s` on time.perf_counter."""
    graph = read_graph(wanted.path)
    posed = problem_of(graph)
    if wanted.start == "file" and posed.given is None:
        raise DataError(f"{wanted.path}: no vertices to start from, expected --start nothing")
    before_s = time.perf_counter()
    solved = solve_posed(posed, wanted.start != "nothing", wanted.robust)
    solve_s = time.perf_counter() - before_s
    if wanted.out is not None:
        _write(wanted.out, solved_graph(graph, posed, solved.state), solved)
    summary = {
        "poses": posed.problem.n_poses,
        "landmarks": posed.problem.n_tags,
        "chi2_initial": solved.chi2_initial,
        "chi2_final": solved.chi2_final,
        "iterations": solved.iterations,
        "converged": solved.converged,
        "wall_s": time.perf_counter() - began_s,
        "solve_s": solve_s,
        "peak_mb": peak_mb(),
    }
    return summary, solved.rejected


def peak_mb() -> float:
    """The most memory this process has had, in MB (1e6 bytes).

    Linux counts it per program; getrusage would include the program that started this one.
    """
    try:
        for line in STATUS.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    except OSError:
        pass
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def _write(out: Path, graph: Graph, solved: SolvedGraph) -> None:
    comment = f"solved from {graph.path.name}: chi2 {solved.chi2_final:.6g}"
    try:
        with out.open("w", encoding="utf-8") as file:
            write_g2o(file, graph, [comment])
    except OSError as error:
        raise DataError(f"{out}: cannot be written: {error.strerror}") from None
