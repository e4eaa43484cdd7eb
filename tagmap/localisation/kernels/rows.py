"""A scene linearised at a pose, in space or in the plane: see tagmap.localisation.rows.

N sightings of k numbers each, D = d + 1, dof = 6 or 3. Arrays are C-contiguous.
"""

import math

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry.kernels.compiled import compiled, internal
from tagmap.localisation.kernels.dense import cholesky


@compiled
def place(T_map_base: Array, p_map: Array, T_cam_base: Array, p_base: Array, p_cam: Array) -> None:
    """p_map (N, d) in base and in cam, (N, d) each."""
    d = p_map.shape[1]
    for n in range(len(p_map)):
        for i in range(d):
            p_base[n, i] = 0.0
            for j in range(d):
                p_base[n, i] += T_map_base[j, i] * (p_map[n, j] - T_map_base[j, d])
        for i in range(d):
            p_cam[n, i] = T_cam_base[n, i, d]
            for j in range(d):
                p_cam[n, i] += T_cam_base[n, i, j] * p_base[n, j]


@internal
def lever(J: Array, p: Array, H: Array) -> None:
    """H (k, dof) = -J [I, -hat(p)], J (k, d) by a point p (d,) of base: by the pose of base."""
    d = len(p)
    for i in range(len(J)):
        for j in range(d):
            H[i, j] = -J[i, j]
        if d == 2:
            H[i, 2] = J[i, 0] * p[1] - J[i, 1] * p[0]
        else:
            H[i, 3] = J[i, 1] * p[2] - J[i, 2] * p[1]
            H[i, 4] = J[i, 2] * p[0] - J[i, 0] * p[2]
            H[i, 5] = J[i, 0] * p[1] - J[i, 1] * p[0]


@internal
def whiten(L: Array, x: Array) -> None:
    """x (k, m) becomes L^-1 x."""
    for i in range(len(x)):
        for j in range(x.shape[1]):
            for m in range(i):
                x[i, j] -= L[i, m] * x[m, j]
            x[i, j] /= L[i, i]


@compiled
def linearise(
    T_map_base: Array,
    T_cam_base: Array,
    p_base: Array,
    root: Array,
    cov: Array,
    drift: Array,
    most: float,
    r: Array,
    J: Array,
    H: Array,
    H_tag: Array,
    valid: Mask,
) -> None:
    """r (N, k) holds z - h and J (N, k, d) dh / dp_cam; drift (N, dof, dof) or (0, dof, dof).

    Whitens r and fills H, H_tag and valid; what has more than `most` times its own noise, or is not
    finite, is not valid, and its rows are zero.
    """
    N, k, d = J.shape
    dof = H.shape[2]
    S, J_base, system = np.empty((k, k)), np.empty((k, d)), np.empty((k, 1 + dof + d))
    for n in range(N):
        for i in range(k):
            for j in range(d):
                J_base[i, j] = 0.0
                for m in range(d):
                    J_base[i, j] += J[n, i, m] * T_cam_base[n, m, j]
        lever(J_base, p_base[n], H[n])
        _by_tag(J_base, T_map_base, root[n], H_tag[n])
        added, least = 0.0, math.inf
        for i in range(k):
            for j in range(k):
                S[i, j] = 0.0
                for m in range(d):
                    S[i, j] += H_tag[n, i, m] * H_tag[n, j, m]
                if len(drift):
                    for a in range(dof):
                        for b in range(dof):
                            S[i, j] += H[n, i, a] * drift[n, a, b] * H[n, j, b]
            added += S[i, i]
            least = min(least, cov[n, i, i])
        for i in range(k):
            for j in range(k):
                S[i, j] += cov[n, i, j]
        valid[n] = added < most * least and cholesky(S)
        for i in range(k):
            system[i, 0] = r[n, i]
            for j in range(dof):
                system[i, 1 + j] = H[n, i, j]
            for j in range(d):
                system[i, 1 + dof + j] = H_tag[n, i, j]
        if valid[n]:
            whiten(S, system)
        for i in range(k):
            r[n, i] = system[i, 0] if valid[n] else 0.0
            for j in range(dof):
                H[n, i, j] = system[i, 1 + j] if valid[n] else 0.0
            for j in range(d):
                H_tag[n, i, j] = system[i, 1 + dof + j] if valid[n] else 0.0


@compiled
def _by_tag(J_base: Array, T_map_base: Array, root: Array, H_tag: Array) -> None:
    """H_tag (k, d) = J_base R_map_base^T root."""
    k, d = J_base.shape
    for i in range(k):
        for j in range(d):
            H_tag[i, j] = 0.0
            for m in range(d):
                across = 0.0
                for b in range(d):
                    across += J_base[i, b] * T_map_base[m, b]
                H_tag[i, j] += across * root[m, j]
