"""What `tagmap localize` answers to one view: the pose, its promise, and what to doubt."""

import math
from typing import Any

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.cylinder import distance_m
from tagmap.localisation.dop import Dop, dop
from tagmap.localisation.integrity.judge import Verdict, judge
from tagmap.localisation.integrity.parts import without
from tagmap.localisation.integrity.promise import Promise
from tagmap.localisation.integrity.reasons import reasons
from tagmap.localisation.pose import Doubt, Poses, locate, missing
from tagmap.localisation.view import NOTHING, Known, Views, isotropic, prior_of_base
from tagmap.records import arrays
from tagmap.records.transform import Transform
from tagmap.records.view_file import PriorPose, ViewFile


def answer(file: ViewFile, rig: StereoRig, promise: Promise | None = None) -> dict[str, Any]:
    """As documented in docs/localisation.md. Numbers that do not exist are None."""
    ids = sorted(set(file.left) | set(file.right))
    T_base_cam = np.eye(4) if file.T_base_cam is None else arrays.matrix(file.T_base_cam)
    frame = "T_map_cam" if file.T_base_cam is None else "T_map_base"
    if not ids:
        return _nothing(frame) | {"reasons": missing(Doubt.FEW)}
    seen = np.array([[tag in file.left, tag in file.right] for tag in ids])
    views, known = _views(file, ids, seen, rig.sigma_px), _known(file.prior, T_base_cam)
    verdict = judge(rig, views, known, promise, se3.inverse(T_base_cam)[:3, 3])
    poses = locate(rig, without(views, verdict.excluded), known)
    said = {"chi2": _number(poses.chi2[0]), "dof": max(int(poses.dof[0]), 0)}
    if not (poses.n[0] and verdict.agreed[0]):
        why = missing(int(poses.doubt[0])) if verdict.agreed[0] else reasons(verdict, ids)
        return _nothing(frame) | said | {"reasons": why}
    used, T = ~verdict.excluded[0], poses.T_map_cam[0]
    p_map = np.array([file.tags[tag] for tag in ids])[used]
    return (
        _pose(frame, poses, T_base_cam)
        | said
        | {
            "inliers": [tag for tag, is_in in zip(ids, used, strict=True) if is_in],
            "excluded": [tag for tag, is_in in zip(ids, used, strict=True) if not is_in],
        }
        | as_facts(dop(rig, p_map, T, seen[used]))
        | {"danger_cylinder_m": distance_m(p_map, T[:3, 3])}
        | _promise(poses, verdict, ids)
    )


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


def _known(prior: PriorPose | None, to_cam: Array) -> Known:
    if prior is None:
        return NOTHING
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


def _nothing(frame: str) -> dict[str, Any]:
    """All keys, for no pose."""
    return {
        frame: None,
        "cov": None,
        "chi2": None,
        "dof": 0,
        "inliers": [],
        "excluded": [],
        "alternatives": [],
        **as_facts(None),
        "danger_cylinder_m": None,
        "protection_level_m": None,
        "state": "lost",
        "reasons": [],
    }


def _pose(frame: str, poses: Poses, T_base_cam: Array) -> dict[str, Any]:
    found = int(poses.n[0])
    T_all = poses.T_all[0, :found] @ se3.inverse(T_base_cam)
    Ad = se3.adjoint(T_base_cam)
    cov = Ad @ poses.cov[0] @ Ad.T
    return {
        frame: _transform(T_all[0]),
        "cov": cov.tolist() if np.isfinite(cov).all() else None,
        "alternatives": [
            {frame: _transform(T), "chi2": float(chi2)}
            for T, chi2 in zip(T_all[1:], poses.chi2_all[0, 1:found], strict=True)
        ],
    }


def _promise(poses: Poses, verdict: Verdict, ids: list[str]) -> dict[str, Any]:
    why = missing(int(poses.doubt[0])) + reasons(verdict, ids)
    return {
        "protection_level_m": _number(verdict.level_m[0]),
        "state": "degraded" if why else "good",
        "reasons": why,
    }


def as_facts(at: Dop | None) -> dict[str, float | None]:
    """The four numbers by name; None for what is infinite or not known."""
    return {name: None if at is None else _number(getattr(at, name)) for name in Dop.__slots__}


def _number(value: Array | float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _transform(T: Array) -> dict[str, list[float]]:
    p, q_wxyz = se3.to_p_q(T)
    return {"p_m": p.tolist(), "q_wxyz": q_wxyz.tolist()}
