"""The joint problem once more, plainly: all unknowns in one vector, Jacobians by differences.

Unknowns are ordered poses, tags, scales; nothing is eliminated, nothing is sparse.
"""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.factors import (
    lie,
    odometry_residual,
    prior_difference,
    scale_residual,
    sighting_residual,
    surveyed_residual,
)
from tagmap.estimation.linear import NormalEquations, dense
from tagmap.estimation.linearise import updated
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.residuals import Weights

STEP = 1e-6


def size(problem: Problem) -> int:
    return problem.n_poses * problem.pose_dof + problem.n_border


def moved(problem: Problem, state: State, delta: Array) -> State:
    """The real update, by one vector."""
    split = problem.n_poses * problem.pose_dof
    poses = delta[:split].reshape(problem.n_poses, problem.pose_dof)
    return updated(problem, state, poses, delta[split:])


def residual(problem: Problem, state: State, weights: Weights) -> Array:
    """All residuals times the roots of their weights; those of weight zero do not count."""
    kind = problem.kind
    parts = []
    for block, w in zip(problem.sightings, weights.sightings, strict=True):
        used = np.flatnonzero(w > 0.0)
        r = sighting_residual(kind, block.take(used), state)
        parts.append(r * np.sqrt(w[used])[:, None])
    parts.append(odometry_residual(kind, problem.odometry, state) * _root(weights.odometry))
    parts.append(surveyed_residual(problem.surveyed, state) * _root(weights.surveyed))
    parts.append(scale_residual(problem, state))
    if problem.prior is not None:
        root = np.linalg.cholesky(problem.prior.information).T
        parts.append(root @ prior_difference(kind, problem.prior, state))
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


def assembled(equations: NormalEquations) -> tuple[Array, Array]:
    """The structured normal equations as one matrix and one vector."""
    n, dof, _ = equations.diagonal.shape
    A = np.zeros((n, dof, n, dof))
    for i in range(n):
        A[i, :, i, :] = equations.diagonal[i]
        if i + 1 < n:
            A[i + 1, :, i, :] = equations.next[i]
            A[i, :, i + 1, :] = equations.next[i].T
    A = A.reshape(n * dof, n * dof)
    B = dense(equations.coupling)
    H = np.block([[A, B], [B.T, equations.border]])
    return H, np.concatenate([equations.gradient_pose.ravel(), equations.gradient_border])


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
        still = np.zeros(len(problem.scale_names))
        columns.append(np.concatenate([pose.ravel(), tag.ravel(), still]) / (2.0 * STEP))
    motions, _ = np.linalg.qr(np.stack(columns, axis=1))
    return motions


def covariance(problem: Problem, state: State, weights: Weights) -> Array:
    """Of all unknowns. On a floating map: of what remains after the best alignment of the tags.

    pinv(H) is the covariance under inner constraints on everything; the S-transformation
    (Baarda 1973) carries it over to inner constraints on the tags alone.
    """
    H, _ = normal_equations(problem, state, weights)
    if len(problem.surveyed) or problem.prior is not None:
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


def at(problem: Problem, T: Array, p: Array) -> State:
    """A state with all scales at 1."""
    return State(T, p, np.ones(len(problem.scale_names)))


def halved(weights: Weights) -> Weights:
    """Weights 1, 1/2, 0 in turn, to see that all are honoured."""
    turn = (1.0, 0.5, 0.0)
    return replace(
        weights,
        sightings=tuple(np.resize(turn, len(w)) for w in weights.sightings),
        surveyed=np.resize((0.5, 1.0), len(weights.surveyed)),
    )
