"""What `tagmap localize` answers to one view: the pose, its promise, and what to doubt."""

import math
from typing import Any

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.cylinder import distance_m
from tagmap.localisation.dop import Dop, dop
from tagmap.localisation.pose import Poses, locate, missing
from tagmap.localisation.view import NOTHING, Known, Views, isotropic, prior_of_base
from tagmap.records import arrays
from tagmap.records.transform import Transform
from tagmap.records.view_file import PriorPose, ViewFile


def answer(file: ViewFile, rig: StereoRig) -> dict[str, Any]:
    """As documented in docs/localisation.md. Numbers that do not exist are None."""
    ids = sorted(set(file.left) | set(file.right))
    T_base_cam = None if file.T_base_cam is None else arrays.matrix(file.T_base_cam)
    if not ids:
        return _facts([], _none(), None, T_base_cam) | {"reasons": missing(1)}
    seen = np.array([[tag in file.left, tag in file.right] for tag in ids])
    poses = locate(rig, _views(file, ids, seen, rig.sigma_px), _known(file.prior, T_base_cam))
    place = None
    if poses.n[0]:
        p_map = np.array([file.tags[tag] for tag in ids])
        T = poses.T_map_cam[0]
        place = dop(rig, p_map, T, seen), distance_m(p_map, T[:3, 3])
    return _facts(ids, poses, place, T_base_cam)


def _views(file: ViewFile, ids: list[str], seen: Array, sigma_px: float) -> Views:
    nowhere = (0.0, 0.0)
    z = [[*file.left.get(tag, nowhere), *file.right.get(tag, nowhere)] for tag in ids]
    p_map = np.array([[file.tags[tag] for tag in ids]])
    information = isotropic(seen[None], file.sigma_px or sigma_px)
    return Views(p_map, np.array([z]), information, _tag_cov(file, ids))


def _tag_cov(file: ViewFile, ids: list[str]) -> Array | None:
    given = file.tag_cov_m2
    if given is None:
        return None
    if isinstance(given, float | int):
        return np.tile(given * np.eye(3), (1, len(ids), 1, 1))
    upper = [given[tag] if isinstance(given, dict) else given for tag in ids]
    return np.array([[arrays.covariance(one) for one in upper]])


def _known(prior: PriorPose | None, T_base_cam: Array | None) -> Known:
    if prior is None:
        return NOTHING
    to_cam = np.eye(4) if T_base_cam is None else T_base_cam
    T_known, information, up = None, None, None
    if isinstance(prior.cov, tuple):
        about_base = isinstance(prior.T_map_base, Transform)
        T = prior.T_map_base if about_base else prior.T_map_cam
        assert isinstance(T, Transform)
        cov = arrays.covariance(prior.cov)
        pose = prior_of_base(arrays.matrix(T), cov, to_cam if about_base else np.eye(4))
        T_known, information = pose.T_map_cam, pose.information
    if isinstance(prior.up_cam, tuple):
        up = np.array([prior.up_cam])
    elif isinstance(prior.up_base, tuple):
        up = np.array([prior.up_base]) @ to_cam[:3, :3]
    return Known(T_known, information, up_cam=up, sigma_up_rad=prior.sigma_up_rad)


def _facts(
    ids: list[str], poses: Poses, place: tuple[Dop, float | None] | None, T_base_cam: Array | None
) -> dict[str, Any]:
    found, doubt = int(poses.n[0]), int(poses.doubt[0])
    frame = "T_map_cam" if T_base_cam is None else "T_map_base"
    to_cam = np.eye(4) if T_base_cam is None else T_base_cam
    T_all = [T @ se3.inverse(to_cam) for T in poses.T_all[0, :found]]
    Ad = se3.adjoint(to_cam)
    cov = Ad @ poses.cov[0] @ Ad.T
    at, cylinder = place if place is not None else (None, None)
    return {
        frame: _transform(T_all[0]) if found else None,
        "cov": cov.tolist() if found and np.isfinite(cov).all() else None,
        "chi2": _number(poses.chi2[0]),
        "dof": max(int(poses.dof[0]), 0),
        "inliers": ids if found else [],
        "excluded": [],
        "alternatives": [
            {frame: _transform(T), "chi2": float(chi2)}
            for T, chi2 in zip(T_all[1:], poses.chi2_all[0, 1:found], strict=True)
        ],
        **as_facts(at),
        "danger_cylinder_m": cylinder,
        "protection_level_m": None,
        "state": "lost" if not found else "degraded" if doubt else "good",
        "reasons": missing(doubt),
    }


def as_facts(at: Dop | None) -> dict[str, float | None]:
    """The four numbers by name; None for what is infinite or not known."""
    return {name: None if at is None else _number(getattr(at, name)) for name in Dop.__slots__}


def _number(value: Array | float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _transform(T: Array) -> dict[str, list[float]]:
    p, q_wxyz = se3.to_p_q(T)
    return {"p_m": p.tolist(), "q_wxyz": q_wxyz.tolist()}


def _none() -> Poses:
    nan, zero = np.full((1, 4, 4, 4), np.nan), np.zeros(1, dtype=np.int64)
    return Poses(
        nan[:, 0],
        np.full((1, 6, 6), np.nan),
        nan[:, 0, 0, 0],
        zero,
        zero + 1,
        zero,
        nan,
        nan[:, 0, 0],
    )
