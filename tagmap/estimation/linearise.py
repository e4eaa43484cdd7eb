"""From factors to normal equations: J'J and J'r, summed where the unknowns meet."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from tagmap.conventions import Array, Index
from tagmap.estimation.factors import (
    lie,
    odometry_residual,
    odometry_terms,
    prior_difference,
    scale_residual,
    sighting_residual,
    sighting_terms,
    surveyed_residual,
)
from tagmap.estimation.linear import NormalEquations
from tagmap.estimation.problem import Prior, Problem, Sightings, State


@dataclass(frozen=True, slots=True)
class Residuals:
    """Squared whitened residuals per factor: one (K,) per block of sightings, then the others."""

    sightings: tuple[Array, ...]
    odometry: Array
    surveyed: Array
    scale: Array
    prior: float


def squared_residuals(problem: Problem, state: State) -> Residuals:
    """NaN of a sighting that cannot be (a tag behind the camera) becomes inf."""
    kind = problem.kind
    seen = [_square(sighting_residual(kind, block, state)) for block in problem.sightings]
    return Residuals(
        sightings=tuple(np.where(np.isnan(r2), np.inf, r2) for r2 in seen),
        odometry=_square(odometry_residual(kind, problem.odometry, state)),
        surveyed=_square(surveyed_residual(problem.surveyed, state)),
        scale=scale_residual(problem, state) ** 2,
        prior=_prior_square(problem, state),
    )


@dataclass(frozen=True, slots=True)
class Weights:
    """Robust weight of each factor, 0..1, in the order of Residuals."""

    sightings: tuple[Array, ...]
    odometry: Array
    surveyed: Array


def unit_weights(problem: Problem) -> Weights:
    return Weights(
        tuple(np.ones(len(block)) for block in problem.sightings),
        np.ones(len(problem.odometry.first)),
        np.ones(len(problem.surveyed)),
    )


def linearise(problem: Problem, state: State, weights: Weights) -> NormalEquations:
    """Weighted normal equations at `state`."""
    n, dof = problem.n_poses, problem.pose_dof
    diagonal = np.zeros((n, dof, dof))
    following = np.zeros((max(n - 1, 0), dof, dof))
    gradient_pose = np.zeros((n, dof))
    border = np.zeros((problem.n_border, problem.n_border))
    gradient_border = np.zeros(problem.n_border)

    _add_odometry(problem, state, weights.odometry, diagonal, following, gradient_pose)
    couplings = [
        _add_sightings(problem, block, state, w, diagonal, gradient_pose, border, gradient_border)
        for block, w in zip(problem.sightings, weights.sightings, strict=True)
    ]
    _add_surveyed(problem, state, weights.surveyed, border, gradient_border)
    _add_scales(problem, state, border, gradient_border)
    if problem.prior is not None:
        couplings.append(
            _add_prior(
                problem, problem.prior, state, diagonal, gradient_pose, border, gradient_border
            )
        )
    coupling = _coupling(couplings, (n * dof, problem.n_border))
    return NormalEquations(diagonal, following, coupling, border, gradient_pose, gradient_border)


def updated(problem: Problem, state: State, poses: Array, border: Array) -> State:
    """T @ exp(delta), p + dp, s + ds."""
    split = problem.n_tags * problem.tag_dof
    return State(
        T=state.T @ lie(problem.kind).exp(poses),
        p=state.p + border[:split].reshape(state.p.shape),
        scale=state.scale + border[split:],
    )


@dataclass(frozen=True, slots=True)
class Entries:
    """Entries of the coupling B by row and column, each (K,); those at one place add up."""

    rows: Index
    columns: Index
    values: Array


def _coupling(parts: list[Entries], shape: tuple[int, int]) -> sparse.csc_matrix:
    if not parts:
        return sparse.csc_matrix(shape)
    rows = np.concatenate([part.rows for part in parts])
    columns = np.concatenate([part.columns for part in parts])
    values = np.concatenate([part.values for part in parts])
    return sparse.csc_matrix((values, (rows, columns)), shape=shape)


def _square(r: Array) -> Array:
    squared: Array = np.einsum("ka,ka->k", r, r)
    return squared


def _sum_by(index: Index, size: int, values: Array) -> Array:
    """Sum rows of `values` (K, ...) that share an index: (size, ...)."""
    k = len(index)
    gather = sparse.csr_matrix((np.ones(k), (index, np.arange(k))), shape=(size, k))
    summed = np.asarray(gather @ values.reshape(k, -1))
    return summed.reshape(size, *values.shape[1:])


def _add_odometry(
    problem: Problem, state: State, w: Array, diagonal: Array, following: Array, gradient: Array
) -> None:
    first = problem.odometry.first
    r, J_i, J_j = odometry_terms(problem.kind, problem.odometry, state)
    wJ_i, wJ_j = J_i * w[:, None, None], J_j * w[:, None, None]
    diagonal[first] += _gram(wJ_i, J_i)
    diagonal[first + 1] += _gram(wJ_j, J_j)
    following[first] += _gram(wJ_j, J_i)
    gradient[first] += np.einsum("kab,ka->kb", wJ_i, r)
    gradient[first + 1] += np.einsum("kab,ka->kb", wJ_j, r)


def _add_sightings(
    problem: Problem,
    block: Sightings,
    state: State,
    w: Array,
    diagonal: Array,
    gradient_pose: Array,
    border: Array,
    gradient_border: Array,
) -> Entries:
    """Adds in place and returns the block's part of the coupling B."""
    used = np.flatnonzero(w > 0.0)
    block, w = block.take(used), w[used]
    n, dof = problem.n_poses, problem.pose_dof
    terms = sighting_terms(problem.kind, block, state)
    J_border, columns = _border_jacobian(problem, block, terms.J_tag, terms.J_scale)
    wJ_pose, wJ_border = terms.J_pose * w[:, None, None], J_border * w[:, None, None]

    diagonal += _sum_by(block.pose, n, _gram(wJ_pose, terms.J_pose))
    gradient_pose += _sum_by(block.pose, n, np.einsum("kab,ka->kb", wJ_pose, terms.r))
    np.add.at(gradient_border, columns, np.einsum("kab,ka->kb", wJ_border, terms.r))
    square = _gram(wJ_border, J_border)
    np.add.at(border, (columns[:, :, None], columns[:, None, :]), square)

    entries = _gram(wJ_pose, J_border)
    rows = block.pose[:, None] * dof + np.arange(dof)
    return Entries(
        np.broadcast_to(rows[:, :, None], entries.shape).ravel(),
        np.broadcast_to(columns[:, None, :], entries.shape).ravel(),
        entries.ravel(),
    )


def _border_jacobian(
    problem: Problem, block: Sightings, J_tag: Array, J_scale: Array
) -> tuple[Array, Index]:
    """J (K, c, d [+ 1]) by the tag and, if it has one, the scale; their columns in the border."""
    d = problem.tag_dof
    columns = block.tag[:, None] * d + np.arange(d)
    if not len(block) or block.scale[0] < 0:
        return J_tag, columns
    scale_column = problem.n_tags * d + block.scale[:, None]
    return np.concatenate([J_tag, J_scale[:, :, None]], axis=2), np.hstack([columns, scale_column])


def _add_surveyed(problem: Problem, state: State, w: Array, border: Array, gradient: Array) -> None:
    surveyed, d = problem.surveyed, problem.tag_dof
    columns = surveyed.tag[:, None] * d + np.arange(d)
    wJ = surveyed.whiten * w[:, None, None]
    np.add.at(border, (columns[:, :, None], columns[:, None, :]), _gram(wJ, surveyed.whiten))
    r = surveyed_residual(surveyed, state)
    np.add.at(gradient, columns, np.einsum("kab,ka->kb", wJ, r))


def _add_scales(problem: Problem, state: State, border: Array, gradient: Array) -> None:
    columns = problem.n_tags * problem.tag_dof + np.arange(len(problem.scale_names))
    border[columns, columns] += problem.scale_sigma**-2.0
    gradient[columns] += scale_residual(problem, state) / problem.scale_sigma


def _prior_square(problem: Problem, state: State) -> float:
    if problem.prior is None:
        return 0.0
    difference = prior_difference(problem.kind, problem.prior, state)
    return float(difference @ problem.prior.information @ difference)


def _add_prior(
    problem: Problem,
    prior: Prior,
    state: State,
    diagonal: Array,
    gradient_pose: Array,
    border: Array,
    gradient_border: Array,
) -> Entries:
    """Adds in place and returns the prior's coupling of the first pose with tags."""
    dof, d = problem.pose_dof, problem.tag_dof
    information = prior.information
    gradient = information @ prior_difference(problem.kind, prior, state)
    columns = (prior.tag[:, None] * d + np.arange(d)).ravel()
    diagonal[0] += information[:dof, :dof]
    gradient_pose[0] += gradient[:dof]
    border[np.ix_(columns, columns)] += information[dof:, dof:]
    gradient_border[columns] += gradient[dof:]
    rows = np.repeat(np.arange(dof), len(columns))
    return Entries(rows, np.tile(columns, dof), information[:dof, dof:].ravel())


def _gram(left: Array, right: Array) -> Array:
    """left' right per factor: (K, a, b), (K, a, c) -> (K, b, c)."""
    product: Array = np.swapaxes(left, -1, -2) @ right
    return product
