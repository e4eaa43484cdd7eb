"""The joint problem once more, plainly: all unknowns in one vector, Jacobians by differences.

Unknowns are ordered poses, tags, calibration; nothing is eliminated, nothing is sparse.
"""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.problem import Problem, State, lie
from tagmap.estimation.residuals import Weights
from tagmap.estimation.system import Point, System
from tagmap.geometry import so3
from tests.estimation.factors import (
    condensed_residual,
    odometry_residual,
    prior_residual,
    sighting_residual,
    surveyed_residual,
)

STEP = 1e-6


def size(problem: Problem) -> int:
    border = problem.n_tags * problem.tag_dof + len(problem.calibration)
    return problem.n_poses * problem.pose_dof + border


def moved(problem: Problem, state: State, delta: Array) -> State:
    """The real update, by one vector."""
    split = problem.n_poses * problem.pose_dof
    poses = delta[:split].reshape(problem.n_poses, problem.pose_dof)
    tags, calibration = np.split(delta[split:], [problem.n_tags * problem.tag_dof])
    return State(
        T=state.T @ lie(problem.kind).exp(poses),
        p=state.p + tags.reshape(state.p.shape),
        calibration=state.calibration + calibration,
    )


def residual(problem: Problem, state: State, weights: Weights) -> Array:
    """All residuals times the roots of their weights; those of weight zero do not count."""
    parts = []
    for block, w in zip(problem.sightings, weights.sightings, strict=True):
        used = np.flatnonzero(w > 0.0)
        r = sighting_residual(problem, block.take(used), state)
        parts.append(r * np.sqrt(w[used])[:, None])
    parts.append(odometry_residual(problem, state) * _root(weights.odometry))
    parts.append(surveyed_residual(problem.surveyed, state) * _root(weights.surveyed))
    parts.append(prior_residual(problem, state))
    parts.append(condensed_residual(problem, state))
    return np.concatenate([part.ravel() for part in parts])


def _root(w: Array) -> Array:
    column: Array = np.sqrt(w)[:, None]
    return column


def jacobian(problem: Problem, state: State, weights: Weights) -> Array:
    """Central differences through the real update, (rows, unknowns)."""
    columns = []
    for unit in np.eye(size(problem)):
        ahead = residual(problem, moved(problem, state, STEP * unit), weights)
        behind = residual(problem, moved(problem, state, -STEP * unit), weights)
        columns.append((ahead - behind) / (2.0 * STEP))
    return np.stack(columns, axis=1)


def normal_equations(problem: Problem, state: State, weights: Weights) -> tuple[Array, Array]:
    """J'J and J'r."""
    J = jacobian(problem, state, weights)
    return J.T @ J, J.T @ residual(problem, state, weights)


def assembled(system: System, point: Point) -> tuple[Array, Array]:
    """The structured normal equations as one matrix and one vector, poses in their own axes."""
    linear, axes, d = point.linear, system.packed.axes, system.problem.tag_dof
    n, m, q = len(linear.diagonal), len(linear.tag_diagonal), len(linear.calibration)
    tags, unknowns = 6 * n + 3 * np.arange(m), 6 * n + 3 * m + np.arange(q)
    H = np.zeros((6 * n + 3 * m + q,) * 2)
    for i in range(n):
        rows = slice(6 * i, 6 * i + 6)
        H[rows, rows] = linear.diagonal[i]
        if i + 1 < n:
            H[6 * i + 6 : 6 * i + 12, rows] = linear.following[i]
            H[rows, 6 * i + 6 : 6 * i + 12] = linear.following[i].T
        for k in range(linear.first[i], linear.first[i + 1]):
            W, at = np.zeros((3, 3)), tags[linear.tag[k]]
            W[np.triu_indices(3)] = linear.seen[k, :6]
            W = W + np.triu(W, 1).T
            lever = linear.p[linear.tag[k]] - linear.T[i, :3, 3]
            by_pose = np.vstack([-W, -so3.hat(lever) @ W])
            H[rows, at : at + 3] += by_pose
            H[at : at + 3, rows] += by_pose.T
        for column, coupling in zip(
            linear.slot_column[i], linear.pose_calibration[i].T, strict=True
        ):
            if column >= 0:
                H[rows, unknowns[column]] += coupling
                H[unknowns[column], rows] += coupling
    for t, at in enumerate(tags):
        H[at : at + 3, at : at + 3] = linear.tag_diagonal[t]
        H[at : at + 3, unknowns] = linear.tag_calibration[t]
        H[unknowns, at : at + 3] = linear.tag_calibration[t].T
    H[np.ix_(unknowns, unknowns)] = linear.calibration
    if system.problem.condensed is not None:
        between = system.problem.condensed.information.toarray().reshape(m, 3, m, 3)
        between[np.arange(m), :, np.arange(m), :] = 0.0
        H[6 * n : 6 * n + 3 * m, 6 * n : 6 * n + 3 * m] += between.reshape(3 * m, 3 * m)
    g = np.concatenate(
        [linear.pose_gradient.ravel(), linear.tag_gradient.ravel(), linear.calibration_gradient]
    )
    to_map = np.eye(len(H))
    for i in range(n):
        R = point.values.T[i, :3, :3]
        to_map[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = R
        to_map[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = R
    kept = np.concatenate(
        [
            (6 * np.arange(n)[:, None] + axes).ravel(),
            (tags[:, None] + np.arange(d)).ravel(),
            unknowns,
        ]
    )
    return (to_map.T @ H @ to_map)[np.ix_(kept, kept)], (to_map.T @ g)[kept]


def gauss_newton(problem: Problem, state: State, weights: Weights, rounds: int = 10) -> State:
    """Least squares at fixed weights; the shortest step where the frame is free."""
    for _ in range(rounds):
        H, g = normal_equations(problem, state, weights)
        state = moved(problem, state, -np.linalg.pinv(H, rcond=1e-11, hermitian=True) @ g)
    return state


def frame_motions(problem: Problem, state: State) -> Array:
    """Orthonormal (unknowns, 3 or 6): how all unknowns change when the map frame moves."""
    group = lie(problem.kind)
    columns = []
    for unit in np.eye(problem.pose_dof):
        ahead, behind = group.exp(STEP * unit), group.exp(-STEP * unit)
        pose = group.log(group.inverse(behind @ state.T) @ (ahead @ state.T))
        tag = group.act(ahead, state.p) - group.act(behind, state.p)
        still = np.zeros(len(problem.calibration))
        columns.append(np.concatenate([pose.ravel(), tag.ravel(), still]) / (2.0 * STEP))
    motions, _ = np.linalg.qr(np.stack(columns, axis=1))
    return motions


def covariance(problem: Problem, state: State, weights: Weights) -> Array:
    """Of all unknowns. On a floating map: of what remains after the best alignment of the tags.

    pinv(H) is the covariance under inner constraints on everything; the S-transformation
    (Baarda 1973) carries it over to inner constraints on the tags alone.
    """
    H, _ = normal_equations(problem, state, weights)
    if len(problem.surveyed):
        return np.linalg.inv(H)
    motions = frame_motions(problem, state)
    free = np.eye(len(H)) - motions @ motions.T
    inverse = free @ np.linalg.inv(free @ H @ free + motions @ motions.T) @ free
    first = problem.n_poses * problem.pose_dof
    tags = np.zeros_like(motions)
    tags[first : first + problem.n_tags * problem.tag_dof] = motions[
        first : first + problem.n_tags * problem.tag_dof
    ]
    S = np.eye(len(H)) - motions @ np.linalg.solve(tags.T @ motions, tags.T)
    cov: Array = S @ inverse @ S.T
    return cov


def halved(weights: Weights) -> Weights:
    """Weights 1, 1/2, 0 in turn, to see that all are honoured."""
    turn = (1.0, 0.5, 0.0)
    return replace(
        weights,
        sightings=tuple(np.resize(turn, len(w)) for w in weights.sightings),
        surveyed=np.resize((0.5, 1.0), len(weights.surveyed)),
    )
