"""Draws the structure of the joint problem: `python docs/estimation_pictures.py`."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fleet.benchmarks.estimation.world import Size, make
from tagmap.conventions import Mask
from tagmap.estimation.condense import factored
from tagmap.estimation.condensed import whole
from tagmap.estimation.elimination import eliminated
from tagmap.estimation.preconditioner import Pattern, Segments
from tagmap.estimation.system import System

IMAGE = Path(__file__).with_name("pictures") / "joint-problem.png"
SIZE = Size(tags=150, poses=900)


def draw() -> Figure:
    """Blocks that are not zero, of a small world."""
    world = make(SIZE)
    problem = world.problem
    system = System(problem)
    point = system.at(system.values(world.true), system.certain())
    L, D = factored(point.linear)
    n, m = problem.n_poses, problem.n_tags
    joint = np.zeros((n + m, n + m), dtype=bool)
    joint[range(n), range(n)] = joint[range(n, n + m), range(n, n + m)] = True
    steps = problem.odometry.first
    joint[steps, steps + 1] = joint[steps + 1, steps] = True
    for block in problem.sightings:
        joint[block.pose, n + block.tag] = joint[n + block.tag, block.pose] = True
    between, corner = point.linear.tag_calibration.copy(), point.linear.calibration.copy()
    rows, columns, blocks = eliminated(point.linear, L, D, between, corner)
    reduced = whole(rows, columns, np.ones_like(blocks), m).toarray()[::3, ::3] != 0.0
    pattern = Pattern.of(Segments.of(system), m)
    cut = np.zeros((m, m), dtype=bool)
    at = np.repeat(np.arange(m), np.diff(pattern.indptr))
    cut[at, pattern.indices] = cut[pattern.indices, at] = True
    figure = Figure(figsize=(10.0, 3.9), layout="constrained")
    titles = (
        f"all unknowns: {n} poses, {m} tags",
        "tags, poses eliminated: S",
        "preconditioner: links of segments cut",
    )
    for axes, matrix, title in zip(
        figure.subplots(1, 3), (joint, reduced, cut), titles, strict=True
    ):
        _show(axes, matrix, title)
    return figure


def _show(axes: Axes, matrix: Mask, title: str) -> None:
    axes.imshow(~matrix, cmap="gray", interpolation="nearest")
    axes.set_title(title, fontsize=10)
    share = 100.0 * matrix.mean()
    axes.set_xlabel(f"{share:.0f} % of the blocks are not zero", fontsize=9)
    axes.set_xticks([])
    axes.set_yticks([])


if __name__ == "__main__":
    draw().savefig(IMAGE, dpi=110)
