"""Tag positions from sightings, given poses: the start values of tags."""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array, Index, Kind, Mask
from tagmap.estimation.kernels import tag_fit
from tagmap.estimation.kernels.stereo_points import triangulate
from tagmap.estimation.packing import lower, poses_in_space, rig_numbers
from tagmap.estimation.problem import Problem, Sightings, lie
from tagmap.estimation.unknowns import CAMERA, UnknownName
from tagmap.geometry import camera, measurement, se2, se3

ROBUST_ROUNDS = 10
LEAST_PARALLAX = 1e-3
GUESSED_RANGE_M = 5.0
LEAST_DETERMINANT = 1e-12
LOOSE = 0.1


@dataclass(frozen=True, slots=True)
class Points:
    """What each sighting says about where its tag is in base, as a Gaussian in information form.

    pose, tag (K,); p_base (K, d); information (K, d, d), of rank 1 less for a direction only;
    row (K,): the number of the sighting, counted through all blocks of the problem.
    """

    pose: Index
    tag: Index
    p_base: Array
    information: Array
    row: Index

    def of_poses(self, first: int, last: int) -> "Points":
        """The points of poses first..last, both included, whose poses are then numbered from 0."""
        start, stop = np.searchsorted(self.pose, [first, last + 1])
        part = self.take(slice(int(start), int(stop)))
        return replace(part, pose=part.pose - first)

    def among(self, poses: Index) -> "Points":
        """The points of `poses`, ascending, which are then numbered in that order."""
        at = np.minimum(np.searchsorted(poses, self.pose), len(poses) - 1)
        kept = np.flatnonzero(poses[at] == self.pose)
        return replace(self.take(kept), pose=at[kept])

    def take(self, keep: Index | slice) -> "Points":
        return Points(*(getattr(self, name)[keep] for name in _FIELDS))

    def distances(self, T: Array, p: Array) -> Array:
        """Squared distances (K,) from tags p (M, d), by the points' own information; poses T."""
        group = se2 if p.shape[1] == 2 else se3
        offset = group.act(group.inverse(T), p[self.tag]) - self.p_base
        square: Array = np.einsum("ka,kab,kb->k", offset, self.information, offset)
        return square

    def near(self, T: Array, p: Array) -> Mask:
        """(K,) points within a tenth of the way to their tag at p (M, d), as poses T may drift."""
        group = se2 if p.shape[1] == 2 else se3
        there = group.act(group.inverse(T), p[self.tag])
        far = LOOSE**2 * (there**2).sum(axis=1) * np.trace(self.information, axis1=1, axis2=2)
        close: Mask = self.distances(T, p) <= far
        return close


_FIELDS = ("pose", "tag", "p_base", "information", "row")


def points_of(problem: Problem, calibration: Array | None = None) -> Points:
    """Points of all sightings that give one, ascending by pose; a negative disparity gives none.

    calibration (Q,): values of the problem's unknowns; without them sensors are as stated.
    """
    parts, n = [], 0
    for block in problem.sightings:
        part = _points_of_block(
            problem,
            block,
            {}
            if calibration is None
            else {problem.calibration[u].name: float(calibration[u]) for u in block.unknowns},
        )
        parts.append(replace(part, row=part.row + n))
        n += len(block)
    parts = [part for part in parts if len(part.pose)]
    d = problem.tag_dof
    if not parts:
        none = np.zeros(0, dtype=np.int64)
        return Points(none, none, np.zeros((0, d)), np.zeros((0, d, d)), none)
    together = Points(*(np.concatenate([getattr(one, name) for one in parts]) for name in _FIELDS))
    return together.take(np.argsort(together.pose, kind="stable"))


def _points_of_block(
    problem: Problem, block: Sightings, sensor: dict[UnknownName, float]
) -> Points:
    p_cam, information = _in_camera(problem.kind, block, sensor)
    d = problem.tag_dof
    T_base_cam = _mounts(problem.kind, block, sensor)
    R = T_base_cam[:, :d, :d]
    scale = sensor.get("range_scale", 1.0) * sensor.get("stereo_scale", 1.0)
    p_base = lie(problem.kind).act(T_base_cam, p_cam / scale)
    information = R @ (scale**2 * information) @ np.swapaxes(R, -1, -2)
    good = np.isfinite(p_base.sum(axis=1) + information.sum(axis=(1, 2)))
    every = np.arange(len(block))
    return Points(block.pose, block.tag, p_base, information, every).take(np.flatnonzero(good))


def _in_camera(
    kind: Kind, block: Sightings, sensor: dict[UnknownName, float]
) -> tuple[Array, Array]:
    """Points (K, d) in cam and their information (K, d, d)."""
    if block.form == "stereo_px":
        z = block.z.copy()
        z[:, 2] += sensor.get("disparity_px", 0.0)
        z[:, ::2] -= sensor.get("principal_u_px", 0.0)
        z[:, 1::2] -= sensor.get("principal_v_px", 0.0)
        rig, k = rig_numbers(block.rig), len(z)
        p_cam, information = np.empty((k, 3)), np.empty((k, 3, 3))
        triangulate(rig, z, lower(block.whiten), LEAST_DETERMINANT, p_cam, information)
        return p_cam, information
    L = np.asarray(np.linalg.inv(block.whiten), dtype=np.float64)
    cov = L @ np.swapaxes(L, -1, -2)
    given = measurement.to_point(block.form, kind, block.z, cov, block.rig)
    return _directions(block) if given is None else _informed(*given)


def _mounts(kind: Kind, block: Sightings, sensor: dict[UnknownName, float]) -> Array:
    """T_base_cam (K, D, D): base at the time stamp, the camera where it is when it exposes."""
    group = lie(kind)
    T_base_cam: Array = group.inverse(block.T_cam_base)
    if any(name.startswith("camera") for name in sensor):
        offset = [sensor.get(name, 0.0) for part in CAMERA[kind] for name in part]
        T_base_cam = T_base_cam @ group.exp(np.array(offset))
    if block.twist is not None and "time_offset_s" in sensor:
        T_base_cam = group.exp(sensor["time_offset_s"] * block.twist) @ T_base_cam
    return T_base_cam


def _informed(p_cam: Array, cov: Array) -> tuple[Array, Array]:
    """Covariance to information; NaN of a point or covariance that could not be computed."""
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    scale = sigma[:, :, None] * sigma[:, None, :]
    with np.errstate(all="ignore"):
        correlation = cov / scale
        bad = ~(np.linalg.det(correlation) > LEAST_DETERMINANT)[:, None, None]
    regular = np.where(bad, np.eye(cov.shape[1]), correlation)
    return p_cam, np.where(bad, np.nan, np.linalg.inv(regular) / scale)


def _directions(block: Sightings) -> tuple[Array, Array]:
    """Start values where one sighting gives no point; the angle is taken as good to 0.01 rad.

    mono_px: any point of the ray, informed across it only, as for a tag at GUESSED_RANGE_M.
    range_bearing in space: level with the camera, elevation known to half a radian.
    """
    if block.form == "mono_px":
        assert block.rig is not None
        rays = camera.undistort(block.rig.left, block.z)
        p_cam = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
        u = p_cam / np.linalg.norm(p_cam, axis=1, keepdims=True)
        across = np.eye(3) - u[:, :, None] * u[:, None, :]
        return p_cam, across / (0.01 * GUESSED_RANGE_M) ** 2
    r, b = block.z.T
    p_cam = np.stack([-r * np.sin(b), np.zeros_like(r), r * np.cos(b)], axis=1)
    sigma = np.stack([0.01 * r, 0.5 * r, 0.01 * r], axis=1)
    return p_cam, np.eye(3) / sigma[:, :, None] ** 2


@dataclass(frozen=True, slots=True)
class TagFit:
    """p (M, d), information (M, d, d), n (M,) sum of weights; NaN and 0 where not determined."""

    p: Array
    information: Array
    n: Array

    @property
    def determined(self) -> Mask:
        known: Mask = np.isfinite(self.p.sum(axis=1))
        return known


def fit_tags(points: Points, T: Array, n_tags: int) -> TagFit:
    """Robust information-weighted mean per tag (iteratively reweighted, Cauchy loss).

    T (N, D, D): poses. The rounds begin where most points agree: wrong identities, which agree on
    nothing, do not move it.
    """
    d = T.shape[-1] - 1
    order = np.argsort(points.tag, kind="stable")
    k = len(order)
    p_base, information = np.zeros((k, 3)), np.zeros((k, 3, 3))
    p_base[:, :d], information[:, :d, :d] = points.p_base[order], points.information[order]
    p_map, I_map = np.empty((k, 3)), np.empty((k, 6))
    tag_fit.to_map(points.pose[order], p_base, information, poses_in_space(T), p_map, I_map)
    start = np.searchsorted(points.tag[order], np.arange(n_tags + 1))
    mean, total, n = np.empty((n_tags, 3)), np.empty((n_tags, 3, 3)), np.empty(n_tags)
    tag_fit.fit(start, p_map, I_map, d, LEAST_PARALLAX**2, ROBUST_ROUNDS, mean, total, n)
    return TagFit(mean[:, :d].copy(), total[:, :d, :d].copy(), n)
