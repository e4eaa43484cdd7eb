"""What all optimisers are judged by: the cost of where they end, computed here for each of them."""

import math

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.problem import Problem, Sightings, State
from tagmap.geometry import se3, stereo

CHUNK = 50_000


def cost(problem: Problem, state: State) -> float:
    """Sum of squared whitened residuals of a problem in space with stereo sightings.

    Infinite where a tag is not in front of both cameras that saw it.
    """
    odometry, surveyed = problem.odometry, problem.surveyed
    first = odometry.first
    moved = se3.inverse(state.T[first]) @ state.T[first + 1]
    total = _squares(odometry.whiten, se3.log(se3.inverse(odometry.T) @ moved))
    total += _squares(surveyed.whiten, state.p[surveyed.tag] - surveyed.p)
    for block in problem.sightings:
        for start in range(0, len(block), CHUNK):
            total += _of_sightings(block.take(slice(start, start + CHUNK)), state)
    return total if math.isfinite(total) else math.inf


def _of_sightings(block: Sightings, state: State) -> float:
    assert block.rig is not None
    T_cam_map = block.T_cam_base @ se3.inverse(state.T[block.pose])
    px, _ = stereo.project(block.rig, se3.act(T_cam_map, state.p[block.tag]))
    return _squares(block.whiten, block.z - px)


def _squares(whiten: Array, residual: Array) -> float:
    return float((np.einsum("kij,kj->ki", whiten, residual) ** 2).sum())
