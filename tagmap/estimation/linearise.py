"""From factors to normal equations: J'J and J'r, summed where the unknowns meet."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from tagmap.conventions import Array, Index
from tagmap.estimation.factors import (
    SightingTerms,
    lie,
    odometry_terms,
    prior_difference,
    scale_residual,
    sighting_terms,
    surveyed_residual,
)
from tagmap.estimation.linear import Coupling, NormalEquations
from tagmap.estimation.problem import Prior, Problem, Sightings, State
from tagmap.estimation.residuals import Weights
from tagmap.estimation.sums import sum_by

DENSE_ENTRIES = 50_000


@dataclass(frozen=True, slots=True)
class _Entries:
    """Entries of the coupling B by row and column, each (K,); those at one place add up."""

    rows: Index
    columns: Index
    values: Array


@dataclass(frozen=True, slots=True)
class _Sums:
    """Normal equations in the making (see NormalEquations): factors add to them in place."""

    diagonal: Array
    following: Array
    gradient_pose: Array
    border: Array
    gradient_border: Array
    coupling: list[_Entries]


def linearise(problem: Problem, state: State, weights: Weights) -> NormalEquations:
    """Weighted normal equations at `state`."""
    n, dof, m = problem.n_poses, problem.pose_dof, problem.n_border
    sums = _Sums(
        diagonal=np.zeros((n, dof, dof)),
        following=np.zeros((max(n - 1, 0), dof, dof)),
        gradient_pose=np.zeros((n, dof)),
        border=np.zeros((m, m)),
        gradient_border=np.zeros(m),
        coupling=[],
    )
    _add_odometry(sums, problem, state, weights.odometry)
    for block, w in zip(problem.sightings, weights.sightings, strict=True):
        _add_sightings(sums, problem, block, state, w)
    _add_surveyed(sums, problem, state, weights.surveyed)
    _add_scales(sums, problem, state)
    if problem.prior is not None:
        _add_prior(sums, problem, problem.prior, state)
    return NormalEquations(
        sums.diagonal,
        sums.following,
        _coupling(sums.coupling, n * dof, m),
        sums.border,
        sums.gradient_pose,
        sums.gradient_border,
    )


def updated(problem: Problem, state: State, poses: Array, border: Array) -> State:
    """T @ exp(delta), p + dp, s + ds."""
    split = problem.n_tags * problem.tag_dof
    return State(
        T=state.T @ lie(problem.kind).exp(poses),
        p=state.p + border[:split].reshape(state.p.shape),
        scale=state.scale + border[split:],
    )


def _coupling(parts: list[_Entries], rows: int, columns: int) -> Coupling:
    """Dense while it is small: then building a sparse matrix costs more than it saves."""
    none = [np.zeros(0, dtype=np.int64)]
    at_row = np.concatenate([part.rows for part in parts] or none)
    at_column = np.concatenate([part.columns for part in parts] or none)
    values = np.concatenate([part.values for part in parts] or [np.zeros(0)])
    if rows * columns <= DENSE_ENTRIES:
        return sum_by(at_row * columns + at_column, rows * columns, values).reshape(rows, columns)
    return sparse.csc_matrix((values, (at_row, at_column)), shape=(rows, columns))


def _add_odometry(sums: _Sums, problem: Problem, state: State, w: Array) -> None:
    first = problem.odometry.first
    r, J_i, J_j = odometry_terms(problem.kind, problem.odometry, state)
    wJ_i, wJ_j = J_i * w[:, None, None], J_j * w[:, None, None]
    sums.diagonal[first] += _gram(wJ_i, J_i)
    sums.diagonal[first + 1] += _gram(wJ_j, J_j)
    sums.following[first] += _gram(wJ_j, J_i)
    sums.gradient_pose[first] += _against(wJ_i, r)
    sums.gradient_pose[first + 1] += _against(wJ_j, r)


def _add_sightings(sums: _Sums, problem: Problem, block: Sightings, state: State, w: Array) -> None:
    used = np.flatnonzero(w > 0.0)
    block, w = block.take(used), w[used]
    terms = sighting_terms(problem.kind, block, state)
    wJ_pose, wJ_tag = terms.J_pose * w[:, None, None], terms.J_tag * w[:, None, None]
    n, n_tags = problem.n_poses, problem.n_tags

    sums.diagonal[:] += sum_by(block.pose, n, _gram(wJ_pose, terms.J_pose))
    sums.gradient_pose[:] += sum_by(block.pose, n, _against(wJ_pose, terms.r))
    _add_tag_blocks(sums.border, sum_by(block.tag, n_tags, _gram(wJ_tag, terms.J_tag)))
    by_tag = sum_by(block.tag, n_tags, _against(wJ_tag, terms.r)).ravel()
    sums.gradient_border[: by_tag.size] += by_tag

    rows = block.pose[:, None] * problem.pose_dof + np.arange(problem.pose_dof)
    columns = block.tag[:, None] * problem.tag_dof + np.arange(problem.tag_dof)
    sums.coupling.append(_outer_entries(rows, columns, _gram(wJ_pose, terms.J_tag)))
    if block.scale >= 0:
        _add_scale_terms(sums, problem, block, terms, w)


def _add_tag_blocks(border: Array, blocks: Array) -> None:
    """Add blocks (M, d, d) along the diagonal of the border's tag part."""
    n_tags, d, _ = blocks.shape
    tags = border[: n_tags * d, : n_tags * d].reshape(n_tags, d, n_tags, d)
    each = np.arange(n_tags)
    tags[each, :, each, :] += blocks


def _outer_entries(rows: Index, columns: Index, values: Array) -> _Entries:
    """values (K, a, b) at rows (K, a) and columns (K, b)."""
    return _Entries(
        np.broadcast_to(rows[:, :, None], values.shape).ravel(),
        np.broadcast_to(columns[:, None, :], values.shape).ravel(),
        values.ravel(),
    )


def _add_scale_terms(
    sums: _Sums, problem: Problem, block: Sightings, terms: SightingTerms, w: Array
) -> None:
    """What the scale of `block` has to do with itself, with tags and with poses."""
    column = problem.n_tags * problem.tag_dof + block.scale
    J = terms.J_scale
    wJ = J * w[:, None]
    sums.border[column, column] += np.vdot(wJ, J)
    sums.gradient_border[column] += np.vdot(wJ, terms.r)
    with_tags = sum_by(block.tag, problem.n_tags, _against(terms.J_tag, wJ)).ravel()
    sums.border[column, : with_tags.size] += with_tags
    sums.border[: with_tags.size, column] += with_tags
    rows = block.pose[:, None] * problem.pose_dof + np.arange(problem.pose_dof)
    columns = np.full((len(block), 1), column)
    sums.coupling.append(_outer_entries(rows, columns, _against(terms.J_pose, wJ)[:, :, None]))


def _add_surveyed(sums: _Sums, problem: Problem, state: State, w: Array) -> None:
    surveyed, n_tags = problem.surveyed, problem.n_tags
    wJ = surveyed.whiten * w[:, None, None]
    _add_tag_blocks(sums.border, sum_by(surveyed.tag, n_tags, _gram(wJ, surveyed.whiten)))
    by_tag = _against(wJ, surveyed_residual(surveyed, state))
    gradient = sum_by(surveyed.tag, n_tags, by_tag).ravel()
    sums.gradient_border[: gradient.size] += gradient


def _add_scales(sums: _Sums, problem: Problem, state: State) -> None:
    columns = problem.n_tags * problem.tag_dof + np.arange(len(problem.scale_names))
    sums.border[columns, columns] += problem.scale_sigma**-2.0
    sums.gradient_border[columns] += scale_residual(problem, state) / problem.scale_sigma


def _add_prior(sums: _Sums, problem: Problem, prior: Prior, state: State) -> None:
    dof, d = problem.pose_dof, problem.tag_dof
    information = prior.information
    gradient = information @ prior_difference(problem.kind, prior, state)
    columns = (prior.tag[:, None] * d + np.arange(d)).ravel()
    sums.diagonal[0] += information[:dof, :dof]
    sums.gradient_pose[0] += gradient[:dof]
    sums.border[np.ix_(columns, columns)] += information[dof:, dof:]
    sums.gradient_border[columns] += gradient[dof:]
    rows = np.repeat(np.arange(dof), len(columns))
    cross = information[:dof, dof:].ravel()
    sums.coupling.append(_Entries(rows, np.tile(columns, dof), cross))


def _gram(left: Array, right: Array) -> Array:
    """left' right per factor: (K, a, b), (K, a, c) -> (K, b, c)."""
    product: Array = np.swapaxes(left, -1, -2) @ right
    return product


def _against(J: Array, r: Array) -> Array:
    """J' r per factor: (K, a, b), (K, a) -> (K, b)."""
    product: Array = np.einsum("kab,ka->kb", J, r)
    return product
