"""The peer: the same joint problem as a factor graph of GTSAM, built as its users build theirs.

GTSAM's stereo factor knows one row v of a rectified image pair: the mean of our vL and vR, which
has the variance sigma^2 / 2. Our cost is then twice GTSAM's error, but for the constant
sum (vL - vR)^2 / (2 sigma^2).
"""

from collections.abc import Iterable
from typing import Any

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from fleet.benchmarks.estimation import world
from tagmap.conventions import Array
from tagmap.estimation.problem import Problem, State
from tagmap.geometry import se3

MAX_ITERATIONS = 100
OUR_ORDER = np.array([3, 4, 5, 0, 1, 2])
"""GTSAM's tangent of a pose is (omega, v)."""


class LevenbergMarquardt:
    """Building the graph does not count as solving, in its favour; ordering it does."""

    def __init__(self, problem: Problem, start: State, tolerance: float) -> None:
        self._n_poses, self._n_tags = problem.n_poses, problem.n_tags
        self._graph, self._start = graph(problem), values(start)
        self._options = gtsam.LevenbergMarquardtParams()
        self._options.setRelativeErrorTol(tolerance)
        self._options.setMaxIterations(MAX_ITERATIONS)
        self._end: Any = None
        self.iterations, self.converged = 0, False

    def solve(self) -> None:
        """Where it gives up, what it has reached stands."""
        optimiser = gtsam.LevenbergMarquardtOptimizer(self._graph, self._start, self._options)
        try:
            optimiser.optimizeSafely()
        except RuntimeError:
            self.converged = False
        else:
            self.converged = optimiser.iterations() < MAX_ITERATIONS
        self._end, self.iterations = optimiser.values(), optimiser.iterations()

    def state(self) -> State:
        return state_of(self._end, self._n_poses, self._n_tags)


def graph(problem: Problem) -> Any:
    """All factors of a problem made by estimation_world."""
    return together([*stereo_factors(problem), *step_factors(problem), *survey_factors(problem)])


def together(factors: Iterable[Any]) -> Any:
    """As a graph."""
    whole = gtsam.NonlinearFactorGraph()
    for factor in factors:
        whole.add(factor)
    return whole


def values(state: State) -> Any:
    """Of all unknowns."""
    found = gtsam.Values()
    for i, T in enumerate(state.T):
        found.insert(X(i), gtsam.Pose3(T))
    for j, p in enumerate(state.p):
        found.insert(L(j), p)
    return found


def state_of(found: Any, n_poses: int, n_tags: int) -> State:
    """And back."""
    T = np.array([found.atPose3(X(i)).matrix() for i in range(n_poses)])
    p = np.array([found.atPoint3(L(j)) for j in range(n_tags)])
    return State(T, p, np.zeros(0))


def stereo_factors(problem: Problem) -> list[Any]:
    """One per sighting, in their order."""
    (block,) = problem.sightings
    rig, left = world.RIG, world.RIG.left
    camera = gtsam.Cal3_S2Stereo(
        left.fx_px, left.fy_px, 0.0, left.cx_px, left.cy_px, -rig.T_right_left[0, 3]
    )
    noise = gtsam.noiseModel.Diagonal.Sigmas(world.SIGMA_PX * np.array([1.0, 1.0, np.sqrt(0.5)]))
    T_base_cam = gtsam.Pose3(se3.inverse(block.T_cam_base[0]))
    rows = zip(_gtsam_pixels(block.z), block.pose.tolist(), block.tag.tolist(), strict=True)
    return [
        gtsam.GenericStereoFactor3D(gtsam.StereoPoint2(*z), noise, X(i), L(j), camera, T_base_cam)
        for z, i, j in rows
    ]


def step_factors(problem: Problem) -> list[Any]:
    """One per odometry step, in their order."""
    noise = gtsam.noiseModel.Diagonal.Sigmas(world.SIGMA_STEP[OUR_ORDER])
    odometry = problem.odometry
    return [
        gtsam.BetweenFactorPose3(X(i), X(i + 1), gtsam.Pose3(T), noise)
        for i, T in zip(odometry.first.tolist(), odometry.T, strict=True)
    ]


def survey_factors(problem: Problem) -> list[Any]:
    """One per surveyed tag, in their order."""
    surveyed = problem.surveyed
    sigma_m = 1.0 / surveyed.whiten[:, 0, 0]
    return [
        gtsam.PriorFactorPoint3(L(j), p, gtsam.noiseModel.Isotropic.Sigma(3, sigma))
        for j, p, sigma in zip(surveyed.tag.tolist(), surveyed.p, sigma_m.tolist(), strict=True)
    ]


def _gtsam_pixels(z: Array) -> list[tuple[float, float, float]]:
    """(uL, uR, v) of each row (uL, vL, uR, vR)."""
    rows: list[tuple[float, float, float]] = np.column_stack(
        [z[:, 0], z[:, 2], 0.5 * (z[:, 1] + z[:, 3])]
    ).tolist()
    return rows
