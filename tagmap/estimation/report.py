"""What the data does not determine, and what sighting would mend it."""

from collections.abc import Iterator

import numpy as np

from tagmap.estimation.linearise import squared_residuals
from tagmap.estimation.merge import least_shared
from tagmap.estimation.optimise import Optimum
from tagmap.estimation.problem import Problem
from tagmap.estimation.stack import Stacked
from tagmap.estimation.start import LEAST_SURVEYED, Start

DOUBTFUL_WEIGHT = 0.5


def report(stacked: Stacked, start: Start, problem: Problem, optimum: Optimum) -> Iterator[str]:
    """One line per finding."""
    yield from _gauge(stacked, start)
    yield from _sessions(stacked, start)
    yield from _tags(stacked, start)
    yield from _surveys(stacked, start, problem, optimum)


def _gauge(stacked: Stacked, start: Start) -> Iterator[str]:
    surveyed = len(stacked.problem.surveyed)
    if start.anchored or not surveyed:
        return
    if surveyed < LEAST_SURVEYED:
        yield f"map is floating: {surveyed} surveyed tags, {LEAST_SURVEYED} needed"
    else:
        yield f"map is floating: the {surveyed} surveyed tags are in line and fix no frame"


def _sessions(stacked: Stacked, start: Start) -> Iterator[str]:
    """Sessions of which some or all keyframes have no chain of sightings to the gauge."""
    seen = _tags_by_session(stacked)
    for s, hello in enumerate(stacked.sessions):
        poses = slice(stacked.bounds[s], stacked.bounds[s + 1])
        withheld = int((~start.placed[poses]).sum())
        if not withheld:
            continue
        shared = sum(bool(start.mapped[tag]) for tag in seen[s])
        total = stacked.bounds[s + 1] - stacked.bounds[s]
        yield (
            f"session {hello.robot}/{hello.session}: {withheld} of {total} keyframes withheld: it "
            f"sees {len(seen[s])} tags, {shared} of them on the map; each unbroken run of odometry "
            f"needs {least_shared(stacked.problem.kind)}, not in line, that agree with the map"
        )


def _tags_by_session(stacked: Stacked) -> list[set[int]]:
    seen: list[set[int]] = [set() for _ in stacked.sessions]
    for block in stacked.problem.sightings:
        session = np.searchsorted(stacked.bounds, block.pose, side="right") - 1
        for pair in np.unique(np.stack([session, block.tag]), axis=1).T:
            seen[pair[0]].add(int(pair[1]))
    return seen


def _tags(stacked: Stacked, start: Start) -> Iterator[str]:
    for tag in np.flatnonzero(~start.mapped):
        yield (
            f"tag {stacked.tags[tag]}: withheld: no keyframe on the map determines its position; "
            "it needs sightings from two directions or one with range"
        )


def _surveys(stacked: Stacked, start: Start, problem: Problem, optimum: Optimum) -> Iterator[str]:
    if not len(problem.surveyed):
        return
    tags = np.flatnonzero(start.mapped)
    r2 = squared_residuals(problem, optimum.state).surveyed
    for i in np.flatnonzero(optimum.weights.surveyed < DOUBTFUL_WEIGHT):
        number = problem.surveyed.tag[i]
        off = np.linalg.norm(optimum.state.p[number] - problem.surveyed.p[i])
        yield (
            f"tag {stacked.tags[tags[number]]}: its surveyed position is {off:.3f} m "
            f"({np.sqrt(r2[i]):.1f} sigma) away from where the robots see it; not used"
        )
