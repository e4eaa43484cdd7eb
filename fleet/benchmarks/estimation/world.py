"""Fleets of robots below ceilings full of tags, of any size: what a joint problem is made of.

Robots roam a hall and look up ahead with a stereo camera; at every pose the lasers light up to
SEEN_AT_ONCE of the tags that both images show. Odometry and pixels have Gaussian noise, a few tags
are surveyed. Worlds repeat bit for bit.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.problem import Odometry, Problem, Sightings, State, Surveyed
from tagmap.geometry import se3, stereo
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig

POSES_PER_ROBOT = 2000
SIGMA_PX = 0.2
SIGMA_STEP = np.array([5e-3, 3e-3, 3e-3, 1e-3, 1e-3, 3e-3])
"""Of an odometry step of STEP_M, in the tangent order (v, omega): m and rad."""
SIGMA_SURVEY_M, SIGMA_PLAN_M = 0.002, 0.3
N_SURVEYED = 5

FOCAL_PX, WIDTH_PX, HEIGHT_PX, BASELINE_M = 420.0, 640, 480, 0.12
IMAGER = Camera(WIDTH_PX, HEIGHT_PX, FOCAL_PX, FOCAL_PX, 320.0, 240.0, np.zeros(5))
RIG = StereoRig(IMAGER, IMAGER, se3.exp(np.array([-BASELINE_M, 0, 0, 0, 0, 0])), SIGMA_PX)
"""Rectified and without distortion: all that GTSAM's stereo factor can express."""

SPACING_M, STEP_M, MARGIN_M, FAR_M = 2.4, 0.25, 5.0, 9.0
SEEN_AT_ONCE = 7
CANDIDATES = 48
CHUNK = 20_000


@dataclass(frozen=True, slots=True)
class Size:
    """How many tags and poses; robots share the poses evenly."""

    tags: int
    poses: int

    @property
    def robots(self) -> int:
        return max(1, self.poses // POSES_PER_ROBOT)


WARM = Size(40, 500)
"""Enough to load all compiled code."""


@dataclass(frozen=True, slots=True)
class World:
    """The problem and its true answer. chain (N,): which robot each pose is of, ascending."""

    problem: Problem
    true: State
    chain: Index


def make(size: Size, seed: int = 0) -> World:
    """Poses that are not a multiple of the robots' number are left out."""
    rng = np.random.default_rng(seed)
    p_map = _ceiling(rng, size.tags)
    T = _drives(rng, size, p_map[:, :2].max(axis=0))
    chain = np.repeat(np.arange(size.robots), len(T) // size.robots)
    surveyed = np.linspace(0, size.tags - 1, N_SURVEYED).astype(np.int64)
    problem = Problem(
        kind="spatial",
        n_poses=len(T),
        n_tags=size.tags,
        odometry=_odometry(rng, T, chain),
        sightings=(_sightings(rng, T, p_map),),
        surveyed=Surveyed(
            surveyed,
            p_map[surveyed] + SIGMA_SURVEY_M * rng.standard_normal((N_SURVEYED, 3)),
            np.tile(np.eye(3) / SIGMA_SURVEY_M, (N_SURVEYED, 1, 1)),
        ),
    )
    return World(problem, State(T, p_map, np.zeros(0)), chain)


def with_plan(world: World, seed: int = 2) -> World:
    """The same world, and a plan of the building that has every tag within SIGMA_PLAN_M.

    Then what a few robots saw first determines a map, as an incremental solver needs.
    """
    problem, rng = world.problem, np.random.default_rng(seed)
    known = problem.surveyed
    others = np.setdiff1d(np.arange(problem.n_tags), known.tag)
    guessed = world.true.p[others] + SIGMA_PLAN_M * rng.standard_normal((len(others), 3))
    planned = Surveyed(
        np.concatenate([known.tag, others]),
        np.concatenate([known.p, guessed]),
        np.concatenate([known.whiten, np.tile(np.eye(3) / SIGMA_PLAN_M, (len(others), 1, 1))]),
    )
    return replace(world, problem=replace(problem, surveyed=planned))


def as_driven(world: World, poses_per_update: int) -> list[Index]:
    """Numbers of the poses of each update, ascending: all robots drive at the same time."""
    robots = int(world.chain[-1]) + 1
    of_robot = np.arange(len(world.chain)).reshape(robots, -1)
    each = max(1, poses_per_update // robots)
    return [of_robot[:, k : k + each].ravel() for k in range(0, of_robot.shape[1], each)]


def _ceiling(rng: np.random.Generator, n: int) -> Array:
    """Tags (n, 3) about the corners of a square grid, 4 to 5.5 m high."""
    side = int(np.ceil(np.sqrt(n)))
    grid = np.stack(np.divmod(np.arange(n), side), axis=1) + 0.5
    flat = SPACING_M * grid + 0.3 * rng.standard_normal((n, 2))
    return np.column_stack([flat, rng.uniform(4.0, 5.5, n)])


def _drives(rng: np.random.Generator, size: Size, far_corner_m: Array) -> Array:
    """T_map_base (N, 4, 4), robot after robot: they wander, and turn back near the walls."""
    robots, steps = size.robots, size.poses // size.robots
    middle = far_corner_m / 2.0
    inner = np.maximum(middle - MARGIN_M, middle / 2.0)
    xy = middle + inner * rng.uniform(-1.0, 1.0, (robots, 2))
    heading = rng.uniform(-np.pi, np.pi, robots)
    T = np.tile(np.eye(4), (robots, steps, 1, 1))
    for k in range(steps):
        c, s = np.cos(heading), np.sin(heading)
        T[:, k, :2, :2] = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], axis=-2)
        T[:, k, :2, 3] = xy
        home = middle - xy
        inwards = np.sin(np.arctan2(home[:, 1], home[:, 0]) - heading)
        near_wall = (np.abs(home) > inner).any(axis=1)
        heading = heading + 0.06 * rng.standard_normal(robots) + 0.3 * near_wall * inwards
        xy = xy + STEP_M * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return T.reshape(-1, 4, 4)


def _T_base_cam() -> Array:
    """0.8 m above the floor, tilted up by 0.7 rad."""
    forward = np.array([np.cos(0.7), 0.0, np.sin(0.7)])
    right = np.array([0.0, -1.0, 0.0])
    R = np.column_stack([right, np.cross(forward, right), forward])
    return se3.from_p_R(np.array([0.1, 0.0, 0.8]), R)


T_BASE_CAM = _T_base_cam()


def _odometry(rng: np.random.Generator, T: Array, chain: Index) -> Odometry:
    first = np.flatnonzero(np.diff(chain) == 0)
    steps = se3.inverse(T[first]) @ T[first + 1]
    steps = steps @ se3.exp(SIGMA_STEP * rng.standard_normal((len(first), 6)))
    return Odometry(first, steps, np.broadcast_to(np.diag(1.0 / SIGMA_STEP), (len(first), 6, 6)))


def _sightings(rng: np.random.Generator, T: Array, p_map: Array) -> Sightings:
    from scipy.spatial import cKDTree

    tree = cKDTree(p_map[:, :2])
    chunks = [
        _lit(rng, tree, p_map, T[start : start + CHUNK], start) for start in range(0, len(T), CHUNK)
    ]
    pose, tag, z = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    n = len(pose)
    return Sightings(
        form="stereo_px",
        rig=RIG,
        pose=pose,
        tag=tag,
        z=z,
        whiten=np.broadcast_to(np.eye(4) / SIGMA_PX, (n, 4, 4)),
        T_cam_base=np.broadcast_to(se3.inverse(T_BASE_CAM), (n, 4, 4)),
    )


def _lit(
    rng: np.random.Generator, tree: Any, p_map: Array, T: Array, start: int
) -> tuple[Index, Index, Array]:
    """pose (K,), numbered from `start`, tag (K,) and noisy stereo pixels (K, 4) of a few poses."""
    T_cam_map = se3.inverse(T @ T_BASE_CAM)
    k = min(CANDIDATES, len(p_map))
    _, near = tree.query(T[:, :2, 3], k=k, distance_upper_bound=FAR_M)
    px = _pixels(T_cam_map, p_map[np.minimum(near, len(p_map) - 1)])
    order = np.where((near < len(p_map)) & _inside(px), rng.random(near.shape), np.inf)
    lit = np.argsort(order, axis=1)[:, :SEEN_AT_ONCE]
    is_lit = np.isfinite(np.take_along_axis(order, lit, axis=1))
    pose = np.repeat(np.arange(len(T)), is_lit.sum(axis=1))
    column = lit[is_lit]
    tag = near[pose, column].astype(np.int64)
    sorted_ = np.lexsort((tag, pose))
    z = px[pose, column][sorted_] + SIGMA_PX * rng.standard_normal((len(pose), 4))
    return pose + start, tag[sorted_], z


def _pixels(T_cam_map: Array, p_map: Array) -> Array:
    px, _ = stereo.project(RIG, se3.act(T_cam_map[:, None], p_map))
    return px


def _inside(px: Array) -> Mask:
    """Both images show it; what is behind a camera has no pixels."""
    size = np.array([WIDTH_PX, HEIGHT_PX, WIDTH_PX, HEIGHT_PX]) - 1.0
    return np.asarray(((px >= 0.0) & (px <= size)).all(axis=-1))
