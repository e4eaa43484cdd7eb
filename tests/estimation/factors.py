"""Residuals and Jacobians of the joint problem, side by side, whitened, batched over factors.

Perturbations: pose T <- T @ exp(delta), tag p <- p + dp, scale s <- s + ds. Every Jacobian is that
of the whitened residual r = W (predicted - measured).
"""

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from tagmap.conventions import Array, Kind
from tagmap.estimation.problem import Odometry, Prior, Problem, Sightings, State, Surveyed
from tagmap.geometry import measurement, se2, se3


def lie(kind: Kind) -> ModuleType:
    """The group of the problem's poses."""
    return se3 if kind == "spatial" else se2


@dataclass(frozen=True, slots=True)
class SightingTerms:
    """r (K, c); J_pose (K, c, dof), J_tag (K, c, d), J_scale (K, c)."""

    r: Array
    J_pose: Array
    J_tag: Array
    J_scale: Array


def sighting_points(kind: Kind, sightings: Sightings, state: State) -> tuple[Array, Array]:
    """p_base (K, d) and p_cam (K, d) of the sighted tags, before any common scale."""
    T = state.T[sightings.pose]
    d = T.shape[-1] - 1
    offset = state.p[sightings.tag] - T[:, :d, d]
    p_base = np.einsum("kji,kj->ki", T[:, :d, :d], offset)
    return p_base, lie(kind).act(sightings.T_cam_base, p_base)


def sighting_scale(sightings: Sightings, state: State) -> float:
    """The factor by which the sensor sees distances too long; 1 where it is not an unknown."""
    return 1.0 if sightings.scale < 0 else float(state.scale[sightings.scale])


def sighting_residual(kind: Kind, sightings: Sightings, state: State) -> Array:
    """Whitened residual (K, c); a point that cannot be seen (behind the camera) gives NaN."""
    _, p_cam = sighting_points(kind, sightings, state)
    scaled = p_cam * sighting_scale(sightings, state)
    predicted, _ = measurement.predict(sightings.form, kind, scaled, sightings.rig)
    raw = measurement.residual(sightings.form, kind, sightings.z, predicted)
    r: Array = np.einsum("kab,kb->ka", sightings.whiten, raw)
    return r


def sighting_terms(kind: Kind, sightings: Sightings, state: State) -> SightingTerms:
    """p_cam = R_cb R^T (p - t) + t_cb, measured at scale s: d p_base = -v - w x p_base + R^T dp."""
    p_base, p_cam = sighting_points(kind, sightings, state)
    scale = sighting_scale(sightings, state)
    predicted, J = measurement.predict(sightings.form, kind, p_cam * scale, sightings.rig)
    raw = measurement.residual(sightings.form, kind, sightings.z, predicted)
    J = sightings.whiten @ J
    d = p_cam.shape[-1]
    J_base = (J @ sightings.T_cam_base[:, :d, :d]) * scale
    R_base_map = np.swapaxes(state.T[sightings.pose][:, :d, :d], -1, -2)
    return SightingTerms(
        r=np.einsum("kab,kb->ka", sightings.whiten, raw),
        J_pose=J_base @ point_by_pose(kind, p_base),
        J_tag=J_base @ R_base_map,
        J_scale=np.einsum("kab,kb->ka", J, p_cam),
    )


def point_by_pose(kind: Kind, p_base: Array) -> Array:
    """d p_base / d delta (K, d, dof) = [-I, [p]x] of a fixed map point."""
    k, d = p_base.shape
    J = np.zeros((k, d, 6 if kind == "spatial" else 3))
    J[:, np.arange(d), np.arange(d)] = -1.0
    if kind == "planar":
        J[:, 0, 2] = p_base[:, 1]
        J[:, 1, 2] = -p_base[:, 0]
        return J
    x, y, z = p_base.T
    J[:, 0, 4], J[:, 0, 5] = -z, y
    J[:, 1, 3], J[:, 1, 5] = z, -x
    J[:, 2, 3], J[:, 2, 4] = -y, x
    return J


def odometry_residual(kind: Kind, odometry: Odometry, state: State) -> Array:
    """W log(T_prev_cur^-1 T_i^-1 T_i+1), (K, dof)."""
    group = lie(kind)
    step = group.inverse(state.T[odometry.first]) @ state.T[odometry.first + 1]
    error = group.log(group.inverse(odometry.T) @ step)
    r: Array = np.einsum("kab,kb->ka", odometry.whiten, error)
    return r


def odometry_terms(kind: Kind, odometry: Odometry, state: State) -> tuple[Array, Array, Array]:
    """r (K, dof), J_first, J_next (K, dof, dof).

    J_next = W Jr^-1(e), J_first = -J_next Ad((T_i^-1 T_i+1)^-1).
    """
    group = lie(kind)
    step = group.inverse(state.T[odometry.first]) @ state.T[odometry.first + 1]
    error = group.log(group.inverse(odometry.T) @ step)
    J_next = odometry.whiten @ group.right_jacobian_inverse(error)
    J_first = -J_next @ group.adjoint(group.inverse(step))
    return np.einsum("kab,kb->ka", odometry.whiten, error), J_first, J_next


def surveyed_residual(surveyed: Surveyed, state: State) -> Array:
    """W (p - p_surveyed), (K, d); its Jacobian by the tag is W."""
    r: Array = np.einsum("kab,kb->ka", surveyed.whiten, state.p[surveyed.tag] - surveyed.p)
    return r


def scale_residual(problem: Problem, state: State) -> Array:
    """(s - 1) / sigma, (S,)."""
    r: Array = (state.scale - 1.0) / problem.scale_sigma
    return r


def prior_difference(kind: Kind, prior: Prior, state: State) -> Array:
    """(log(T_mean^-1 T_0), p - p_mean) stacked, (dof + M d,); its Jacobian is taken as identity."""
    group = lie(kind)
    pose = group.log(group.inverse(prior.T) @ state.T[0])
    return np.concatenate([pose, (state.p[prior.tag] - prior.p).ravel()])
