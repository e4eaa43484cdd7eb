"""Rows fused with a prior that knows its correlation with every tag: tagmap.localisation.fusion.

r (N, k), H (N, k, dof), H_tag (N, k, d), all whitened; P (dof, dof), cross (N, dof, d) of the
tags sighted. Arrays are C-contiguous.
"""

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.dense import (
    form_of_inverse,
    invert,
    multiply,
    multiply_transposed,
)


@compiled
def against_prediction(
    r: Array, H: Array, H_tag: Array, P: Array, cross: Array, chi2: Array
) -> None:
    """chi2 (N,) of each sighting by itself; NaN where its covariance is singular."""
    N, k, dof = H.shape
    d = H_tag.shape[2]
    S, HP = np.empty((k, k)), np.empty((k, dof))
    for n in range(N):
        for i in range(k):
            for a in range(dof):
                HP[i, a] = 0.0
                for b in range(dof):
                    HP[i, a] += H[n, i, b] * P[b, a]
        for i in range(k):
            for j in range(k):
                S[i, j] = 1.0 if i == j else 0.0
                for a in range(dof):
                    S[i, j] += HP[i, a] * H[n, j, a]
                    for c in range(d):
                        S[i, j] += H[n, i, a] * cross[n, a, c] * H_tag[n, j, c]
                        S[i, j] += H[n, j, a] * cross[n, a, c] * H_tag[n, i, c]
        chi2[n] = form_of_inverse(S, r[n])


@compiled
def fuse(
    r: Array,
    H: Array,
    H_tag: Array,
    use: Mask,
    P: Array,
    cross: Array,
    start: Array,
    U: Array,
    q: Array,
) -> tuple[Array, Array, Array, Array, float]:
    """delta (dof,), its cov (dof, dof), gain (dof, 2 dof), N (2 dof, 2 dof) and chi2, of the
    sightings in `use`; fills U (N, k, 2 dof) and q (N, k).
    """
    N, k, dof = H.shape
    d = H_tag.shape[2]
    A, y = np.zeros((2 * dof, 2 * dof)), np.zeros(2 * dof)
    for n in range(N):
        for i in range(k):
            q[n, i] = r[n, i] if use[n] else 0.0
            for a in range(dof):
                along = 0.0
                for c in range(d):
                    along += H_tag[n, i, c] * cross[n, a, c]
                U[n, i, a] = H[n, i, a] if use[n] else 0.0
                U[n, i, dof + a] = along if use[n] else 0.0
                q[n, i] -= U[n, i, a] * start[a]
            for a in range(2 * dof):
                y[a] += U[n, i, a] * q[n, i]
                for b in range(a + 1):
                    A[a, b] += U[n, i, a] * U[n, i, b]
    for a in range(2 * dof):
        for b in range(a):
            A[b, a] = A[a, b]
    within, gain, cov = _gains(A, P)
    delta, carried = start.copy(), np.zeros(2 * dof)
    for a in range(2 * dof):
        for b in range(2 * dof):
            carried[a] += within[a, b] * y[b]
        if a < dof:
            delta[a] += carried[a]
    chi2 = 0.0
    for n in range(N):
        for i in range(k):
            seen = q[n, i]
            for a in range(2 * dof):
                q[n, i] -= U[n, i, a] * carried[a]
            chi2 += seen * q[n, i]
    return delta, cov, gain, within, chi2


@compiled
def _gains(A: Array, P: Array) -> tuple[Array, Array, Array]:
    """N (2 dof, 2 dof) = M (1 + A M)^-1, its upper half, and what is left of P (dof, dof)."""
    dof = len(P)
    M, AM = np.zeros((2 * dof, 2 * dof)), np.empty((2 * dof, 2 * dof))
    for a in range(dof):
        for b in range(dof):
            M[a, b] = P[a, b]
        M[a, dof + a] = M[dof + a, a] = 1.0
    multiply(A, M, AM)
    reduced = AM.copy()
    for a in range(2 * dof):
        AM[a, a] += 1.0
    shrink, within = np.empty((2 * dof, 2 * dof)), np.empty((2 * dof, 2 * dof))
    invert(AM, shrink)
    multiply(M, shrink, within)
    gain, cov = np.empty((dof, 2 * dof)), np.empty((dof, dof))
    for a in range(dof):
        for b in range(2 * dof):
            gain[a, b] = within[a, b]
    for a in range(dof):
        for b in range(a + 1):
            left, right = P[a, b], P[b, a]
            for c in range(2 * dof):
                left -= gain[a, c] * reduced[c, b]
                right -= gain[b, c] * reduced[c, a]
            cov[a, b] = cov[b, a] = 0.5 * (left + right)
    return within, gain, cov


@compiled
def fuse_what_agrees(
    r: Array,
    H: Array,
    H_tag: Array,
    use: Mask,
    width: Index,
    bounds: Array,
    P: Array,
    cross: Array,
    start: Array,
    U: Array,
) -> tuple[Array, Array, Array]:
    """Fuse; while the residuals as a whole are too large, take out of `use` what fits worst.

    width (N,) numbers of each sighting; bounds: the chi2 acceptable by how many numbers there are.
    delta, cov and gain as of `fuse`.
    """
    N, k, _ = H.shape
    q, S, half = np.empty((N, k)), np.empty((k, k)), np.empty((k, U.shape[2]))
    while True:
        delta, cov, gain, within, chi2 = fuse(r, H, H_tag, use, P, cross, start, U, q)
        numbers = 0
        for n in range(N):
            numbers += width[n] if use[n] else 0
        if chi2 <= bounds[numbers]:
            break
        worst, excess = -1, 1.0
        for n in range(N):
            if use[n]:
                multiply(U[n], within, half)
                multiply_transposed(half, U[n], S)
                for i in range(k):
                    for j in range(k):
                        S[i, j] = (1.0 if i == j else 0.0) - S[i, j]
                own = form_of_inverse(S, q[n]) / bounds[width[n]]
                if own > excess:
                    worst, excess = n, own
        if worst < 0:
            break
        use[worst] = False
    return delta, cov, gain


@compiled
def cross_after(
    cross: Array,
    tag: Index,
    gain: Array,
    U: Array,
    H: Array,
    H_tag: Array,
    J: Array,
    out: Array,
) -> None:
    """out (M, dof, d) = (I - K H) J cross for every tag of the map, less K H_tag for those sighted.

    U is zero where a sighting was not used. Most tags were never seen: their rows are zero.
    """
    N, k, dof = H.shape
    d = cross.shape[2]
    seen, left, turned = np.zeros((2 * dof, dof)), np.empty((dof, dof)), np.empty((dof, dof))
    for n in range(N):
        for i in range(k):
            for a in range(2 * dof):
                for b in range(dof):
                    seen[a, b] += U[n, i, a] * H[n, i, b]
    multiply(gain, seen, left)
    for a in range(dof):
        for b in range(dof):
            left[a, b] = (1.0 if a == b else 0.0) - left[a, b]
    multiply(left, J, turned)
    transform(turned, cross, out)
    for n in range(N):
        for a in range(dof):
            for i in range(k):
                along = 0.0
                for b in range(2 * dof):
                    along += gain[a, b] * U[n, i, b]
                for c in range(d):
                    out[tag[n], a, c] -= along * H_tag[n, i, c]


@compiled
def transform(A: Array, cross: Array, out: Array) -> None:
    """out (M, dof, d) = A cross, quick where rows are zero."""
    M, dof, d = cross.shape
    for m in range(M):
        known = False
        for a in range(dof):
            for c in range(d):
                known = known or cross[m, a, c] != 0.0
        for a in range(dof):
            for c in range(d):
                total = 0.0
                if known:
                    for b in range(dof):
                        total += A[a, b] * cross[m, b, c]
                out[m, a, c] = total
