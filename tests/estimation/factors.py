"""Residuals of the joint problem, plainly: the reference that compiled code must agree with."""

import numpy as np

from tagmap.conventions import Array, Kind
from tagmap.estimation.problem import Odometry, Problem, Sightings, State, Surveyed, lie
from tagmap.geometry import measurement


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


def odometry_residual(kind: Kind, odometry: Odometry, state: State) -> Array:
    """W log(T_prev_cur^-1 T_i^-1 T_i+1), (K, dof)."""
    group = lie(kind)
    step = group.inverse(state.T[odometry.first]) @ state.T[odometry.first + 1]
    error = group.log(group.inverse(odometry.T) @ step)
    r: Array = np.einsum("kab,kb->ka", odometry.whiten, error)
    return r


def surveyed_residual(surveyed: Surveyed, state: State) -> Array:
    """W (p - p_surveyed), (K, d); its Jacobian by the tag is W."""
    r: Array = np.einsum("kab,kb->ka", surveyed.whiten, state.p[surveyed.tag] - surveyed.p)
    return r


def scale_residual(problem: Problem, state: State) -> Array:
    """(s - 1) / sigma, (S,)."""
    r: Array = (state.scale - 1.0) / problem.scale_sigma
    return r


def condensed_residual(problem: Problem, state: State) -> Array:
    """C' x + C^-1 g with C C' = H, whose square is x' H x + 2 g' x and a constant."""
    condensed = problem.condensed
    if condensed is None:
        return np.zeros(0)
    d, (m, _), q = problem.tag_dof, condensed.p.shape, len(condensed.calibration)
    H = np.zeros((3 * m + q, 3 * m + q))
    H[: 3 * m, : 3 * m] = condensed.information.toarray()
    H[: 3 * m, 3 * m :] = condensed.across.reshape(3 * m, q)
    H[3 * m :, : 3 * m] = H[: 3 * m, 3 * m :].T
    H[3 * m :, 3 * m :] = condensed.corner
    kept = np.concatenate([(3 * np.arange(m)[:, None] + np.arange(d)).ravel(), 3 * m + np.arange(q)])
    g = np.concatenate([condensed.pull.ravel(), condensed.calibration_pull])[kept]
    x = np.concatenate(
        [(state.p - condensed.p[:, :d]).ravel(), state.scale - condensed.calibration]
    )
    C = np.linalg.cholesky(H[np.ix_(kept, kept)])
    r: Array = C.T @ x + np.linalg.solve(C, g)
    return r
