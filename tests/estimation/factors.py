"""Residuals of the joint problem, plainly: the reference that compiled code must agree with."""

from collections.abc import Sequence

import numpy as np

from tagmap.conventions import Array, Kind
from tagmap.estimation.problem import Problem, Sightings, State, Surveyed, lie
from tagmap.estimation.unknowns import CAMERA
from tagmap.geometry import measurement


def values_of(problem: Problem, state: State, places: Sequence[int]) -> dict[str, float]:
    """By name; of two scales for the same, the product."""
    values: dict[str, float] = {}
    for place in places:
        name, value = problem.calibration[place].name, float(state.calibration[place])
        values[name] = values.get(name, 1.0) * value
    return values


def camera_vector(kind: Kind, values: dict[str, float]) -> Array:
    """(dof,) of how the camera sits differently from what is stated, in axes of cam."""
    return np.array([values.get(name, 0.0) for half in CAMERA[kind] for name in half])


def sighting_points(problem: Problem, sightings: Sightings, state: State) -> Array:
    """p_cam (K, d) of the sighted tags as the sensor sees them: scaled, late, from elsewhere."""
    group, values = lie(problem.kind), values_of(problem, state, sightings.unknowns)
    T = state.T[sightings.pose]
    if sightings.twist is not None:
        T = T @ group.exp(values.get("time_offset_s", 0.0) * sightings.twist)
    T_base_cam = group.inverse(sightings.T_cam_base)
    T_base_cam = T_base_cam @ group.exp(camera_vector(problem.kind, values))
    p_cam = group.act(group.inverse(T @ T_base_cam), state.p[sightings.tag])
    return p_cam * values.get("range_scale", 1.0) * values.get("stereo_scale", 1.0)


def sighting_prediction(problem: Problem, sightings: Sightings, state: State) -> Array:
    """What would be measured (K, c); a point that cannot be seen (behind the camera) gives NaN."""
    p_cam = sighting_points(problem, sightings, state)
    z, _ = measurement.predict(sightings.form, problem.kind, p_cam, sightings.rig)
    values = values_of(problem, state, sightings.unknowns)
    if sightings.form in ("stereo_px", "mono_px"):
        off = [values.get("principal_u_px", 0.0), values.get("principal_v_px", 0.0)]
        z = z + np.tile(off, z.shape[1] // 2)
    if sightings.form == "stereo_px":
        z = z - [0.0, 0.0, values.get("disparity_px", 0.0), 0.0]
    return z


def sighting_residual(problem: Problem, sightings: Sightings, state: State) -> Array:
    """Whitened residual (K, c)."""
    predicted = sighting_prediction(problem, sightings, state)
    raw = measurement.residual(sightings.form, problem.kind, sightings.z, predicted)
    r: Array = np.einsum("kab,kb->ka", sightings.whiten, raw)
    return r


def true_steps(problem: Problem, state: State) -> Array:
    """(K, D, D): what odometry measured, its scales taken out."""
    group, odometry = lie(problem.kind), problem.odometry
    if odometry.unknowns is None:
        return odometry.T
    with_none = np.append(state.calibration, 1.0)
    length, turn = with_none[odometry.unknowns].T
    d = problem.tag_dof
    twist = group.log(odometry.T)
    twist[:, :d] /= length[:, None]
    twist[:, d:] /= turn[:, None]
    T: Array = group.exp(twist)
    return T


def odometry_residual(problem: Problem, state: State) -> Array:
    """W log(T_prev_cur^-1 T_i^-1 T_i+1), (K, dof)."""
    group, odometry = lie(problem.kind), problem.odometry
    step = group.inverse(state.T[odometry.first]) @ state.T[odometry.first + 1]
    error = group.log(group.inverse(true_steps(problem, state)) @ step)
    r: Array = np.einsum("kab,kb->ka", odometry.whiten, error)
    return r


def surveyed_residual(surveyed: Surveyed, state: State) -> Array:
    """W (p - p_surveyed), (K, d); its Jacobian by the tag is W."""
    r: Array = np.einsum("kab,kb->ka", surveyed.whiten, state.p[surveyed.tag] - surveyed.p)
    return r


def prior_residual(problem: Problem, state: State) -> Array:
    """(c - mean) / sigma, (Q,)."""
    r: Array = (state.calibration - problem.prior_mean) / problem.prior_sigma
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
    coordinates = (3 * np.arange(m)[:, None] + np.arange(d)).ravel()
    kept = np.concatenate([coordinates, 3 * m + np.arange(q)])
    g = np.concatenate([condensed.pull.ravel(), condensed.calibration_pull])[kept]
    x = np.concatenate(
        [(state.p - condensed.p[:, :d]).ravel(), state.calibration - condensed.calibration]
    )
    C = np.linalg.cholesky(H[np.ix_(kept, kept)])
    r: Array = C.T @ x + np.linalg.solve(C, g)
    return r
