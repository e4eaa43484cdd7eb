"""Linear fusion of a scene's rows with a prior, or with none, and the tests on its residuals.

With a prior this is the Schmidt-Kalman ("consider") update: tag errors e are not estimated but
their correlation C = Cov(delta, e) with the pose is carried, so that seeing the same tag for ever
never makes the pose better than the tag (Schmidt 1966; Jazwinski 1970, section 8.4).

Innovation covariance, with U = [H, H_tag C^T] and M = [[P, I], [I, 0]], whitened:
    S = I + U M U^T,    S^-1 = I - U N U^T,    N = M (I + A M)^-1,    A = U^T U
so everything is solved in 2 dof unknowns, however many sightings there are. Without a prior
U = H and N = A^-1, the usual least squares.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import special

from tagmap.conventions import Array, Index, Mask
from tagmap.localisation.rows import Rows
from tagmap.records.keyframe import MAX_SIGHTINGS

ACCEPT_PROBABILITY = 0.999
_RIDGE = 1e-9


@dataclass(frozen=True, slots=True)
class Prior:
    """Covariance P (dof, dof) of the pose and its correlation C (N, dof, d) with each tag's e."""

    cov: Array
    cross: Array


@dataclass(frozen=True, slots=True)
class Fused:
    """delta (dof,) and the pose's cov (dof, dof) after it; gain (dof, c) with K = gain U^T;
    U (N, k, c) and N (c, c) as above; q (N, k) = S^-1 innovation; chi2 of the innovation.
    """

    delta: Array
    cov: Array
    gain: Array
    U: Array
    N: Array
    q: Array
    chi2: float


def fuse(rows: Rows, prior: Prior | None, start: Array | None = None) -> Fused:
    """`start` (dof,): the prior's mean of delta, 0 unless relinearised away from it."""
    r = rows.r if start is None else rows.r - rows.H @ start
    if prior is None:
        U = rows.H
        cov = N = gain = _inverse(_gram(U))
    else:
        dof = len(prior.cov)
        M = np.zeros((2 * dof, 2 * dof))
        M[:dof, :dof] = prior.cov
        M[:dof, dof:] = M[dof:, :dof] = np.eye(dof)
        U = np.concatenate([rows.H, rows.H_tag @ prior.cross.swapaxes(-1, -2)], axis=-1)
        A = _gram(U)
        shrink = _inverse(np.eye(2 * dof) + A @ M)
        N, gain = M @ shrink, M[:dof] @ shrink
        cov = prior.cov - gain @ A @ M[:dof].T
    y = np.einsum("nkc,nk->c", U, r)
    delta = gain @ y if start is None else start + gain @ y
    q = r - U @ (N @ y)
    return Fused(delta, 0.5 * (cov + cov.T), gain, U, N, q, float(np.einsum("nk,nk", r, q)))


def gain_of_tags(fused: Fused, rows: Rows) -> Array:
    """K H_tag (N, dof, d): how the pose follows the error of each sighted tag."""
    gained: Array = fused.gain @ fused.U.swapaxes(-1, -2) @ rows.H_tag
    return gained


def against_prediction(rows: Rows, cov: Array, cross: Array | None = None) -> Array:
    """chi2 (N,) of each sighting by itself against a pose with `cov`; inf where not valid."""
    U, M = rows.H, cov
    S = U @ M @ U.swapaxes(-1, -2)
    if cross is not None:
        mixed = rows.H @ cross @ rows.H_tag.swapaxes(-1, -2)
        S = S + mixed + mixed.swapaxes(-1, -2)
    S = S + np.eye(S.shape[-1])
    return _mahalanobis(rows.r, S, rows.valid)


def against_others(fused: Fused, used: Mask) -> Array:
    """chi2 (N,) by which each used sighting contradicts the prior and all others together."""
    Q = np.eye(fused.q.shape[1]) * (1.0 + _RIDGE) - fused.U @ fused.N @ fused.U.swapaxes(-1, -2)
    chi2 = _mahalanobis(fused.q, Q, used)
    return np.where(used, chi2, 0.0)


def chi2_bounds(degrees: Index) -> Array:
    """The ACCEPT_PROBABILITY quantile of each number of degrees of freedom."""
    bounds: Array = every_chi2_bound()[degrees]
    return bounds


@cache
def every_chi2_bound() -> Array:
    """By degrees of freedom, up to those of as many sightings as there can be."""
    degrees = np.arange(4 * MAX_SIGHTINGS + 1)
    bounds = special.chdtri(np.maximum(degrees, 1), 1.0 - ACCEPT_PROBABILITY)
    return np.asarray(np.where(degrees > 0, bounds, 0.0), dtype=np.float64)


def chi2_bound(degrees: int) -> float:
    return float(every_chi2_bound()[degrees]) if degrees > 0 else 0.0


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _gram(U: Array) -> Array:
    flat = U.reshape(-1, U.shape[-1])
    return flat.T @ flat


def _mahalanobis(r: Array, S: Array, valid: Mask) -> Array:
    solved = np.linalg.solve(S, r[..., None])[..., 0]
    return np.where(valid, np.einsum("nk,nk->n", r, solved), np.inf)
