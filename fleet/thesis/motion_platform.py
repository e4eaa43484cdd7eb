"""The motion platform of the experiments (4.3): three tags, translated before a fixed camera."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from fleet.thesis.dilution import nearest_pose
from fleet.thesis.imaging import Seen, in_both_images, look, middle_m, thesis_rig
from fleet.thesis.methods import left_rays, pose_of, reconstruct, single_image
from fleet.thesis.setting import triangle
from tagmap.conventions import Array, Mask
from tagmap.errors import DegenerateError
from tagmap.geometry import se3, so3, stereo
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.dop import covariance, looking_at
from tagmap.localisation.pose import locate
from tagmap.localisation.view import Views, inverse_of

TRANSLATION_M = 0.1
TILT_DEG = 30.0
NEAREST_M = 1.2
PLACEMENTS = 2000
_ASIDE_M = 0.15


@dataclass(frozen=True, slots=True)
class Setup:
    """Tags on a circle of baseline_mm (4.2.1: r is the baseline), distance_m from the camera."""

    baseline_mm: float
    distance_m: float

    @property
    def p_map(self) -> Array:
        return triangle(self.baseline_mm / 1e3)


@dataclass(frozen=True, slots=True)
class Estimates:
    """Of S views; NaN where there is none. p_cam (S, 3, 3), p_map_cam (S, 3), axis (S, 3)."""

    p_cam: Array
    p_map_cam: Array
    axis: Array


@dataclass(frozen=True, slots=True)
class Campaign:
    """S = 2 groups views of one set-up: 2 k and 2 k + 1 are before and after a translation.

    cov_single, cov_both (S, 6, 6): least covariance of the pose's tangent (v, omega) in cam axes,
    from the left image and from both.
    """

    setup: Setup
    T_map_cam: Array
    truth: Estimates
    thesis_single: Estimates
    thesis_stereo: Estimates
    ours_single: Estimates
    ours_both: Estimates
    cov_single: Array
    cov_both: Array
    other_root: float


def fitting(setup: Setup, seed: int) -> int:
    """How many of PLACEMENTS of the tags are in both images."""
    T_cam_map = _placements(np.random.default_rng(seed), setup)
    return int(_visible(thesis_rig(), setup, T_cam_map).sum())


@cache
def campaign(setup: Setup, groups: int, seed: int) -> Campaign:
    rng = np.random.default_rng([seed, int(setup.baseline_mm), int(10 * setup.distance_m)])
    rig = thesis_rig()
    T_cam_map = _groups(rng, rig, setup, groups)
    p_cam = se3.act(T_cam_map[:, None], setup.p_map)
    seen = [look(rng, rig, p, setup.distance_m, NEAREST_M) for p in p_cam]
    T_map_cam = se3.inverse(T_cam_map)
    single, both = _optimum(rig, setup, seen, T_map_cam)
    bounds = _bounds(rig, p_cam, np.stack([s.bound for s in seen]))
    thesis_px = np.stack([s.thesis_px for s in seen])
    rays = left_rays(rig, thesis_px)
    start = np.linalg.norm(p_cam, axis=-1)
    alone = _alone(rays, setup, start)
    level = _alone(rays, setup, np.full_like(start, setup.distance_m))
    return Campaign(
        setup,
        T_map_cam,
        Estimates(p_cam, T_map_cam[:, :3, 3], T_map_cam[:, :3, 2]),
        _with_pose(alone, setup),
        _with_pose(reconstruct(rig, thesis_px), setup),
        single,
        both,
        *bounds,
        float((~(np.abs(level - alone).max((1, 2)) < 1e-6)).mean()),
    )


def _placements(rng: np.random.Generator, setup: Setup) -> Array:
    """T_cam_map (PLACEMENTS, 4, 4) of tags before both cameras, TILT_DEG to the axis, turned
    anyhow."""
    tilt = np.deg2rad(TILT_DEG)
    p = setup.distance_m * np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    R_cam_map = looking_at(p, np.zeros(3))[:3, :3].T
    turns = np.zeros((2, PLACEMENTS, 3))
    turns[..., 2] = rng.uniform(-np.pi, np.pi, (2, PLACEMENTS))
    aside = rng.uniform(-_ASIDE_M, _ASIDE_M, (PLACEMENTS, 3)) * [1.0, 1.0, 0.0]
    R = so3.exp(turns[0]) @ R_cam_map @ so3.exp(turns[1])
    return se3.from_p_R(middle_m(setup.distance_m) + aside, R)


def _visible(rig: StereoRig, setup: Setup, T_cam_map: Array) -> Mask:
    return in_both_images(rig, se3.act(T_cam_map[:, None], setup.p_map))


def _groups(rng: np.random.Generator, rig: StereoRig, setup: Setup, count: int) -> Array:
    """T_cam_map (2 count, 4, 4): before and after a translation, in both images both times."""
    found = np.empty((0, 2, 4, 4))
    while len(found) < count:
        before = _placements(rng, setup)
        after, way = before.copy(), rng.standard_normal((PLACEMENTS, 3))
        after[:, :3, 3] += TRANSLATION_M * way / np.linalg.norm(way, axis=-1, keepdims=True)
        good = _visible(rig, setup, before) & _visible(rig, setup, after)
        found = np.concatenate([found, np.stack([before, after], axis=1)[good]])
    return found[:count].reshape(-1, 4, 4)


def _alone(rays: Array, setup: Setup, start_m: Array) -> Array:
    """Relative positions (S, 3, 3) by Newton's method from a single image."""
    found = np.full(rays.shape, np.nan)
    for i in np.flatnonzero(np.isfinite(rays).all((1, 2))):
        try:
            found[i] = single_image(rays[i], setup.p_map, start_m[i])
        except DegenerateError:
            continue
    return found


def _with_pose(p_cam: Array, setup: Setup) -> Estimates:
    p_map_cam, axis = np.full((2, len(p_cam), 3), np.nan)
    for i in np.flatnonzero(np.isfinite(p_cam).all((1, 2))):
        try:
            pose = pose_of(p_cam[i], setup.p_map)
        except DegenerateError:
            continue
        p_map_cam[i], axis[i] = pose.p_map_cam, pose.axis
    return Estimates(p_cam, p_map_cam, axis)


def _optimum(
    rig: StereoRig, setup: Setup, seen: list[Seen], T_map_cam: Array
) -> tuple[Estimates, Estimates]:
    """Of the left image, and of both."""
    z = np.stack([s.ours_px for s in seen])
    cov = np.stack([s.cov for s in seen])
    estimates = []
    for sides in ([True, False], [True, True]):
        poses = locate(rig, Views(setup.p_map[None], z, inverse_of(cov, np.tile(sides, (3, 1)))))
        T = nearest_pose(poses, T_map_cam)
        p_cam = se3.act(se3.inverse(T)[:, None], setup.p_map)
        estimates.append(Estimates(p_cam, T[:, :3, 3], T[:, :3, 2]))
    return estimates[0], estimates[1]


def _bounds(rig: StereoRig, p_cam: Array, cov_px: Array) -> tuple[Array, Array]:
    _, J = stereo.project(rig, p_cam)
    information = np.linalg.inv(cov_px)
    left = J[..., :2, :].swapaxes(-1, -2) @ information[..., :2, :2] @ J[..., :2, :]
    both = J.swapaxes(-1, -2) @ information @ J
    return covariance(p_cam, left), covariance(p_cam, both)


def cov_of_tags(p_cam: Array, cov: Array) -> Array:
    """(S, N, 3, 3) of p_cam (S, N, 3) from that of the pose, cov (S, 6, 6)."""
    B = np.concatenate([np.broadcast_to(-np.eye(3), (*p_cam.shape, 3)), so3.hat(p_cam)], axis=-1)
    spread: Array = B @ cov[:, None] @ B.swapaxes(-1, -2)
    return spread
