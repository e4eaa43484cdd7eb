"""Errors of positions, poses and covariances. Pure functions of arrays."""

from dataclasses import dataclass

import numpy as np

from fleet.evaluation.truth import GROUPS
from tagmap.conventions import Array, Index, Kind

BAND = (0.025, 0.975)


@dataclass(frozen=True, slots=True)
class Nees:
    """Normalised estimation error squared per degree of freedom: 1 when covariances are honest.

    `band`: where 95 % of consistent estimates fall.
    """

    value: float
    dof: int
    band: tuple[float, float]


def rms(lengths: Array) -> float:
    """Root mean square of (N,) numbers."""
    return float(np.sqrt(np.mean(np.square(lengths))))


def position_errors(T: Array, T_true: Array) -> Array:
    """Distances (N,) in m."""
    d = T.shape[-1] - 1
    distance: Array = np.linalg.norm(T[:, :d, d] - T_true[:, :d, d], axis=-1)
    return distance


def rotation_errors(kind: Kind, T: Array, T_true: Array) -> Array:
    """Angles (N,) in rad, of the whole rotation in space, of the heading in the plane."""
    return rotation_angles(kind, GROUPS[kind].inverse(T) @ T_true)


def rotation_angles(kind: Kind, T: Array) -> Array:
    """Angles (N,) in rad of T (N, d, d)."""
    d = T.shape[-1] - 1
    angle: Array = np.linalg.norm(GROUPS[kind].log(T)[:, d:], axis=-1)
    return angle


def relative_errors(
    kind: Kind, t_ns: Index, T: Array, T_true: Array, over_ns: int
) -> tuple[Array, Array]:
    """RPE: error of the motion over `over_ns`, (M,) in m and (M,) in rad.

    Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems (2012), eq. 1. Pairs are each
    pose with the first one at least `over_ns` later, if that is within half as much again.
    """
    later = np.searchsorted(t_ns, t_ns + over_ns)
    first = np.flatnonzero(later < len(t_ns))
    first = first[t_ns[later[first]] - t_ns[first] <= 1.5 * over_ns]
    second = later[first]
    inverse = GROUPS[kind].inverse
    motion = inverse(T[first]) @ T[second]
    true_motion = inverse(T_true[first]) @ T_true[second]
    error = inverse(true_motion) @ motion
    d = T.shape[-1] - 1
    return np.linalg.norm(error[:, :d, d], axis=-1), rotation_angles(kind, error)


def landmark_nees(p: Array, cov: Array, p_true: Array, aligned: bool) -> Nees:
    """NEES of (N, D) positions with covariances (N, D, D), all in the frame of the truth.

    Alignment to the truth takes the error's components along rigid motions G away, so the
    covariance is projected likewise: e^T (P C P)^+ e with P = I - G G^+, of N D - rank(G) degrees
    of freedom. Covariances between landmarks are taken as zero.
    """
    n, dim = p.shape
    blocks = np.zeros((n, dim, n, dim))
    blocks[np.arange(n), :, np.arange(n), :] = cov
    C = blocks.reshape(n * dim, n * dim)
    error = (p - p_true).reshape(-1)
    if not aligned:
        return nees(float(error @ np.linalg.solve(C, error)), n * dim)
    free = _free_directions(p_true)
    whole = float(error @ free @ np.linalg.solve(free.T @ C @ free, free.T @ error))
    return nees(whole, free.shape[1])


def pose_nees(kind: Kind, T: Array, cov: Array, T_true: Array) -> Array:
    """(N,) per degree of freedom: delta of T exp(delta) = T_true, against cov (N, dof, dof)."""
    group = GROUPS[kind]
    delta = group.log(group.inverse(T) @ T_true)
    value: Array = (delta * np.linalg.solve(cov, delta[..., None])[..., 0]).mean(-1)
    return value


def nees(whole: float, dof: int) -> Nees:
    """Band of the chi-square distribution (Bar-Shalom, Li, Kirubarajan 2001, section 5.4)."""
    from scipy.special import gammaincinv

    # As scipy.stats has it, which takes a second to import.
    low, high = (2.0 * float(gammaincinv(0.5 * dof, share)) / dof for share in BAND)
    return Nees(whole / dof, dof, (low, high))


def _free_directions(p: Array) -> Array:
    """Orthonormal basis (N D, N D - rank G) of what is left when rigid motions are taken out."""
    n, dim = p.shape
    centred = p - p.mean(axis=0)
    planes = [(i, j) for i in range(dim) for j in range(i + 1, dim)]
    G = np.zeros((n, dim, dim + len(planes)))
    G[:, :, :dim] = np.eye(dim)
    for k, (i, j) in enumerate(planes):
        G[:, i, dim + k] = -centred[:, j]
        G[:, j, dim + k] = centred[:, i]
    U, s, _ = np.linalg.svd(G.reshape(n * dim, -1), full_matrices=True)
    rank = int((s > 1e-9 * s[0]).sum())
    free: Array = U[:, rank:]
    return free
