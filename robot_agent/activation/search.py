"""Where to shoot, in which order, when it is not known exactly where the target is."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from tagmap.conventions import Array
from tagmap.geometry.scanner.aiming import Aims
from tagmap.geometry.scanner.scanner import Scanner, point


@dataclass(frozen=True, slots=True)
class Search:
    """offsets_m (K, 2) across the beam, the likeliest first, (0, 0) before all; `cov_m` (2, 2) of
    where the target is."""

    offsets_m: Array
    cov_m: Array


def spread(scanner: Scanner, aims: Aims, p_cam: Array) -> Array:
    """(2, 2) in m^2: where one target (3,) is across the beam."""
    by_theta = point(scanner, aims.theta, p_cam).by_theta
    cov: Array = by_theta @ aims.cov_theta @ by_theta.T
    return cov


def plan(cov_m: Array, reach_m: float, most: int, sigmas: float) -> Search:
    """Discs of reach_m on a hexagonal lattice leave no gap when their middles are sqrt(3) reach_m
    apart (Kershner 1939); those within `sigmas`, by their likelihood: a spiral, stretched."""
    edge_m = np.sqrt(3.0) * reach_m
    n = int(np.ceil(sigmas * np.sqrt(np.linalg.eigvalsh(cov_m)[-1]) / edge_m)) + 1
    # More rings than could ever be shot at cost time, and add nothing.
    n = min(n, most)
    i, j = (axis.ravel() for axis in np.mgrid[-2 * n : 2 * n + 1, -n : n + 1])
    lattice = edge_m * np.stack([i + 0.5 * j, np.sqrt(0.75) * j], axis=-1)
    distance = _mahalanobis(lattice, cov_m)
    reached = _mahalanobis(lattice, _sum(sigmas**2 * cov_m, reach_m**2 * np.eye(2))) <= 1.0
    order = np.flatnonzero(reached)[np.argsort(distance[reached], kind="stable")][:most]
    return Search(lattice[order], cov_m)


def p_within(away_m: Array, sigma_m: float, reach_m: float) -> Array:
    """Probability (...) that a point, expected away_m (...) from the beam with sigma_m in each
    direction, is within its reach (Rice distribution)."""
    p: Array = special.chndtr((reach_m / sigma_m) ** 2, 2.0, (away_m / sigma_m) ** 2)
    return p


def p_beside(
    search: Search, offset_m: Array, others_m: Array, reach_m: float, weights: Array | None = None
) -> float:
    """That a beam at offset_m (2,), which lit a tag, lit one of `others_m` (M, 2) and not the
    target at (0, 0): Bayes, with each of them so likely to be there as `weights` (M,) say, against
    1 of the target; None: 1."""
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(search.cov_m)[-1]))
    target = float(p_within(_norm(offset_m), sigma_m, reach_m))
    each = p_within(_norm(others_m - offset_m), sigma_m, reach_m)
    others = float((each if weights is None else weights * each).sum())
    return others / (target + others) if others > 0.0 else 0.0


def _norm(x: Array) -> Array:
    length: Array = np.sqrt((x**2).sum(axis=-1))
    return length


def _sum(A: Array, B: Array) -> Array:
    """An ellipse around every sum of a point of ellipse A and one of B, (2, 2) each: the least by
    trace (Kurzhanski and Valyi 1997, Ellipsoidal Calculus, section 2.2)."""
    p = np.sqrt(np.trace(A) / np.trace(B))
    around: Array = (1.0 + 1.0 / p) * A + (1.0 + p) * B
    return around


def _mahalanobis(x: Array, cov: Array) -> Array:
    chi2: Array = np.einsum("...i,ij,...j->...", x, np.linalg.inv(cov), x)
    return chi2
