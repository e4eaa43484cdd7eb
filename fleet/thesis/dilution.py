"""Dilution of precision round a circle of cameras: the bound, the thesis's method, and ours."""

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeAlias

import numpy as np

from fleet.thesis.setting import FOCAL_PX, PANS, PINHOLE, TILTS_DEG, circle, triangle
from tagmap.conventions import Array
from tagmap.errors import DegenerateError
from tagmap.geometry import se3
from tagmap.localisation.cylinder import danger_cylinder, distance_to
from tagmap.localisation.dop import MM, dop
from tagmap.localisation.pose import Poses, locate
from tagmap.localisation.reference import thesis_pose
from tagmap.localisation.view import Views, isotropic

Unit: TypeAlias = Literal["mm", "px"]

LEFT_ONLY = np.tile([True, False], (3, 1))
_EXACT_PX = 0.02
"""What ours is told of exact pixels: small beside errors of the tags, yet not nothing."""
_FINE_DEG = 0.05
_DRAWN = 4
_FIRST_ORDER = 0.1
"""Of the distance from the danger cylinder: with larger errors the bound is no bound any more."""
_BELIEVABLE = 53.0
"""Chi-square of six degrees of freedom exceeds it once in 10^9."""


@dataclass(frozen=True, slots=True)
class Case:
    """Tags on a circle of r_mm, cameras at R_mm, errors of tags (mm) or pixels (px)."""

    r_mm: float
    R_mm: float
    unit: Unit
    sigma: float

    @property
    def names(self) -> tuple[str, str]:
        if self.unit == "mm":
            return "pdop", "odop_deg_per_mm"
        return "ppdop_mm_per_px", "podop_deg_per_px"


@dataclass(frozen=True, slots=True)
class Trials:
    """dop (2,): RMS errors per unit, of position and of the optical axis; spread (2,) of the DOP
    over the pan angles."""

    dop: Array
    spread: Array


def curve(case: Case, trials: int, seed: int) -> dict[str, Any]:
    """All of one curve of figures 4-5 to 4-9, as JSON. The same for the same arguments.

    Both methods see the same views, and both are judged on those in which Newton's method finds a
    pose: where two roots have merged and gone there is none, and what is nearest is another root.
    """
    return dict(_curve(case, trials, seed))


@cache
def _curve(case: Case, trials: int, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng([seed, int(case.r_mm), int(case.R_mm), int(10 * case.sigma)])
    rows = [_at_tilt(rng, case, tilt, trials) for tilt in TILTS_DEG]
    exact = np.array([bound(case, circle(case.R_mm / MM, tilt)) for tilt in TILTS_DEG])
    distance_mm = danger_distance_mm(case, TILTS_DEG)
    expected_mm = exact[..., 0].mean(1) * case.sigma
    facts = {name: [row.facts[name] for row in rows] for name in rows[0].facts}
    return {
        "r_mm": case.r_mm,
        "R_mm": case.R_mm,
        "unit": case.unit,
        "sigma": case.sigma,
        "names": list(case.names),
        "views_per_tilt": PANS * trials,
        "tilt_deg": TILTS_DEG.tolist(),
        "danger_cylinder_mm": distance_mm.tolist(),
        "first_order": (expected_mm < _FIRST_ORDER * distance_mm).tolist(),
        "bound": _columns(case, exact.mean(1), exact.std(1)),
        "bound_line": line(case),
        "thesis_method": _trials_of(case, [row.thesis for row in rows]),
        "ours": _trials_of(case, [row.ours for row in rows]),
        **facts,
    }


@dataclass(frozen=True, slots=True)
class _Row:
    """facts: lost (share of views in which Newton's method finds no pose), flagged (share of ours
    that come with a doubt), false_promises (number of ours without one that are off by more than
    their covariance allows)."""

    thesis: Trials
    ours: Trials
    facts: dict[str, float]


def _at_tilt(rng: np.random.Generator, case: Case, tilt_deg: float, trials: int) -> _Row:
    T = np.repeat(circle(case.R_mm / MM, tilt_deg), trials, axis=0)
    rays, p_map = _noisy(rng, case, T)
    thesis = _by_thesis(rays, p_map, T, case)
    ours, poses = _by_optimum(rays, p_map, T, case)
    lost = np.isnan(thesis[:, 0])
    facts = {
        "lost": float(lost.mean()),
        "flagged": float((poses.doubt != 0).mean()),
        "false_promises": _false_promises(poses, T),
    }
    return _Row(_rms(case, thesis), _rms(case, np.where(lost[:, None], np.nan, ours)), facts)


def _false_promises(poses: Poses, T_true: Array) -> int:
    sure = poses.doubt == 0
    xi = se3.log(se3.inverse(poses.T_map_cam[sure]) @ T_true[sure])
    mahalanobis2 = (xi * np.linalg.solve(poses.cov[sure], xi[..., None])[..., 0]).sum(-1)
    return int((mahalanobis2 > _BELIEVABLE).sum())


def bound(case: Case, T_map_cam: Array) -> Array:
    """(..., 2) of the best estimator, to first order; infinite on the danger cylinder."""
    found = dop(PINHOLE, triangle(case.r_mm / MM), T_map_cam, LEFT_ONLY)
    return np.stack([getattr(found, name) for name in case.names], axis=-1)


def danger_distance_mm(case: Case, tilt_deg: Array) -> Array:
    """Of the cameras at tilt_deg (T,), all alike round a circle."""
    p = np.stack([circle(case.R_mm / MM, tilt, 1)[0, :3, 3] for tilt in tilt_deg])
    return MM * distance_to(danger_cylinder(triangle(case.r_mm / MM)), p)


@cache
def fine(case: Case) -> tuple[Array, Array]:
    """Tilts (K,) in degrees in small steps, and the bound (K, 2) there, over all pan angles."""
    tilt_deg = np.arange(TILTS_DEG[0], TILTS_DEG[-1] + 1e-9, _FINE_DEG)
    T = np.stack([circle(case.R_mm / MM, tilt, 8) for tilt in tilt_deg])
    return tilt_deg, bound(case, T).mean(axis=1)


def line(case: Case) -> dict[str, list[float]]:
    """Of the fine bound what a picture needs."""
    tilt_deg, bound = fine(case)
    columns = {name: bound[::_DRAWN, i].tolist() for i, name in enumerate(case.names)}
    distance_mm = danger_distance_mm(case, tilt_deg[::_DRAWN])
    tilts = {"tilt_deg": tilt_deg[::_DRAWN].tolist(), "danger_cylinder_mm": distance_mm.tolist()}
    return tilts | columns


def _noisy(rng: np.random.Generator, case: Case, T: Array) -> tuple[Array, Array]:
    """rays (S, 3, 3) as (x, y, 1) and p_map (S, 3, 3), one of them with errors."""
    tags = triangle(case.r_mm / MM)
    p_cam = se3.act(se3.inverse(T)[:, None], tags)
    rays, p_map = p_cam / p_cam[..., 2:], np.broadcast_to(tags, p_cam.shape)
    error = case.sigma * rng.standard_normal(p_cam.shape)
    if case.unit == "mm":
        return rays, p_map + error / MM
    return rays + error * [1.0, 1.0, 0.0] / FOCAL_PX, p_map


def _by_thesis(rays: Array, p_map: Array, T: Array, case: Case) -> Array:
    """Errors (S, 2) of chapter 4's method in m and rad, NaN where Newton's method finds nothing.

    It starts from the true distances: no start could be better.
    """
    tags = triangle(case.r_mm / MM)
    start = np.sqrt(((tags - T[:, None, :3, 3]) ** 2).sum(-1))
    error = np.full((len(T), 2), np.nan)
    for i in range(len(T)):
        try:
            found = thesis_pose(rays[i], p_map[i], start[i])
        except DegenerateError:
            continue
        error[i, 0] = np.linalg.norm(found.p_map_cam - T[i, :3, 3])
        error[i, 1] = angle(found.axis, T[i, :3, 2])
    return error


def _by_optimum(rays: Array, p_map: Array, T: Array, case: Case) -> tuple[Array, Poses]:
    """Errors (S, 2) of the product's pose that is nearest to the truth, NaN where there is none."""
    left = FOCAL_PX * rays[..., :2]
    z = np.concatenate([left, left], axis=-1)
    if case.unit == "mm":
        cov = (case.sigma / MM) ** 2 * np.eye(3)
        views = Views(p_map, z, isotropic(LEFT_ONLY[None], _EXACT_PX), np.tile(cov, (1, 3, 1, 1)))
    else:
        views = Views(np.array(p_map[:1]), z, isotropic(LEFT_ONLY[None], case.sigma))
    poses = locate(PINHOLE, views)
    nearest = nearest_pose(poses, T)
    error = np.linalg.norm(nearest[:, :3, 3] - T[:, :3, 3], axis=-1)
    return np.stack([error, angle(nearest[:, :3, 2], T[:, :3, 2])], axis=-1), poses


def nearest_pose(poses: Poses, T_true: Array) -> Array:
    """T_map_cam (S, 4, 4): of all poses found the one nearest to the truth, NaN where none was.

    Which root is meant is decided by what is not in the view: odometry, gravity, another tag.
    """
    off = np.linalg.norm(poses.T_all[:, :, :3, 3] - T_true[:, None, :3, 3], axis=-1)
    best = np.nan_to_num(off, nan=np.inf).argmin(axis=1)
    return np.asarray(poses.T_all[np.arange(len(best)), best])


def angle(a: Array, b: Array) -> Array:
    """Angle (...) in rad between unit vectors (..., 3), exact for small ones."""
    across = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.arctan2(across, (a * b).sum(-1)))


def _rms(case: Case, error: Array) -> Trials:
    """Of errors (PANS * n, 2) in m and rad, NaN where there is none."""
    square = (error * [MM, np.rad2deg(1.0)] / case.sigma).reshape(PANS, -1, 2) ** 2
    found = np.isfinite(square[..., 0])
    each = [row[ok].mean(axis=0) for row, ok in zip(square, found, strict=True) if ok.any()]
    if not each:
        return Trials(np.full(2, np.nan), np.full(2, np.nan))
    return Trials(np.sqrt(square[found].mean(axis=0)), np.std(np.sqrt(each), axis=0))


def _columns(case: Case, mean: Array, spread: Array) -> dict[str, list[float]]:
    """Lists over the tilts by the names of the case, and their spread over the pan angles."""
    columns = {name: mean[:, i].tolist() for i, name in enumerate(case.names)}
    return columns | {f"{name}_spread": spread[:, i].tolist() for i, name in enumerate(case.names)}


def _trials_of(case: Case, trials: list[Trials]) -> dict[str, list[float]]:
    return _columns(case, *(np.array([getattr(t, n) for t in trials]) for n in ("dop", "spread")))
