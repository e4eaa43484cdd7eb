"""Four ways to begin: what an optimiser is given decides whether it arrives."""

import numpy as np

from fleet.benchmarks.estimation.process import Start
from fleet.benchmarks.estimation.world import World
from tagmap.conventions import Array, Index
from tagmap.estimation.points import Points, fit_tags, points_of
from tagmap.estimation.problem import State
from tagmap.estimation.start import start_from_nothing
from tagmap.geometry import se3

NOISE_M, NOISE_RAD = 0.05, 0.02
LEAST_ALIGNED = 4


def start(world: World, name: Start, seed: int = 1) -> State:
    """Start values of all poses and tags.

    noisy_truth      the truth with errors of NOISE_M and NOISE_RAD
    dead_reckoning   odometry from each robot's true first pose; tags where that puts them
    plain_alignment  each pose by itself laid onto tags that are known to NOISE_M, all its points
                     weighing the same, near or far; with too few of them, odometry from the pose
                     before. Tags where that puts them
    front_end        tagmap's own: weighted, grown along the odometry
    """
    rng = np.random.default_rng(seed)
    if name == "front_end":
        begun = start_from_nothing(world.problem, world.chain)
        assert begun.placed.all()
        assert begun.mapped.all()
        return State(begun.T, begun.p, np.zeros(0))
    if name == "noisy_truth":
        noise = np.repeat([NOISE_M, NOISE_RAD], 3) * rng.standard_normal((len(world.chain), 6))
        return State(world.true.T @ se3.exp(noise), _rough_tags(rng, world), np.zeros(0))
    points = points_of(world.problem)
    if name == "dead_reckoning":
        T = _along_odometry(world, np.full((len(world.chain), 4, 4), np.nan))
    else:
        T = _along_odometry(world, _aligned(points, _rough_tags(rng, world), len(world.chain)))
    return State(T, fit_tags(points, T, world.problem.n_tags).p, np.zeros(0))


def _rough_tags(rng: np.random.Generator, world: World) -> Array:
    p: Array = world.true.p + NOISE_M * rng.standard_normal(world.true.p.shape)
    return p


def _along_odometry(world: World, T: Array) -> Array:
    """Where T (N, 4, 4) is NaN: the pose before and the step from it; a robot's first is true."""
    T = T.copy()
    steps = np.full_like(T, np.nan)
    steps[world.problem.odometry.first + 1] = world.problem.odometry.T
    first = np.diff(world.chain, prepend=-1) != 0
    for i in np.flatnonzero(np.isnan(T[:, 0, 0])):
        T[i] = world.true.T[i] if first[i] else T[i - 1] @ steps[i]
    return T


def _aligned(points: Points, p_map: Array, n_poses: int) -> Array:
    """T (N, 4, 4) by Umeyama's method without weights; NaN with fewer than LEAST_ALIGNED points."""
    n = np.bincount(points.pose, minlength=n_poses)
    each = np.maximum(n, 1)[:, None]
    mean_base = _sum(points.pose, points.p_base, n_poses) / each
    mean_map = _sum(points.pose, p_map[points.tag], n_poses) / each
    base = points.p_base - mean_base[points.pose]
    correlation = p_map[points.tag, :, None] * base[:, None, :]
    U, _, Vt = np.linalg.svd(_sum(points.pose, correlation, n_poses))
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    R = U @ Vt
    T = se3.from_p_R(mean_map - (R @ mean_base[:, :, None])[:, :, 0], R)
    T[n < LEAST_ALIGNED] = np.nan
    return T


def _sum(pose: Index, values: Array, n_poses: int) -> Array:
    """Of values (K, ...) by pose, (N, ...)."""
    total = np.zeros((n_poses, *values.shape[1:]))
    np.add.at(total, pose, values)
    return total
