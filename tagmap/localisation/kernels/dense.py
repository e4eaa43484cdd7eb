"""Small dense matrices in plain loops, which compile in a moment. Arrays are C-contiguous."""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled, internal


@internal
def multiply(A: Array, B: Array, out: Array) -> None:
    """out (n, m) = A (n, k) B (k, m); `out` may be neither."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            total = 0.0
            for m in range(A.shape[1]):
                total += A[i, m] * B[m, j]
            out[i, j] = total


@internal
def multiply_transposed(A: Array, B: Array, out: Array) -> None:
    """out (n, m) = A (n, k) B^T, B (m, k)."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            total = 0.0
            for m in range(A.shape[1]):
                total += A[i, m] * B[j, m]
            out[i, j] = total


@compiled
def invert(A: Array, out: Array) -> None:
    """out = A^-1 (n, n), A is used up; not finite where it is singular. Gauss and Jordan."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            out[i, j] = 1.0 if i == j else 0.0
    for i in range(n):
        p = i
        for j in range(i + 1, n):
            if abs(A[j, i]) > abs(A[p, i]):
                p = j
        scale = 1.0 / A[p, i]
        for m in range(n):
            A[i, m], A[p, m] = A[p, m], A[i, m]
            out[i, m], out[p, m] = out[p, m], out[i, m]
        for m in range(n):
            A[i, m] *= scale
            out[i, m] *= scale
        for j in range(n):
            if j != i:
                factor = A[j, i]
                for m in range(n):
                    A[j, m] -= factor * A[i, m]
                    out[j, m] -= factor * out[i, m]


@internal
def cholesky(S: Array) -> bool:
    """The lower factor of S (n, n) in its place; False where there is none."""
    for j in range(len(S)):
        for i in range(j, len(S)):
            total: float = S[i, j]
            for m in range(j):
                total -= S[i, m] * S[j, m]
            if i > j:
                S[i, j] = total / S[j, j]
            elif total > 0.0:
                S[j, j] = math.sqrt(total)
            else:
                return False
    return True


@internal
def form_of_inverse(S: Array, r: Array) -> float:
    """r^T S^-1 r of a symmetric S (n, n), which is used up."""
    n = len(r)
    x = r.copy()
    for i in range(n):
        p = i
        for j in range(i + 1, n):
            if abs(S[j, i]) > abs(S[p, i]):
                p = j
        for j in range(n):
            S[i, j], S[p, j] = S[p, j], S[i, j]
        x[i], x[p] = x[p], x[i]
        for j in range(i + 1, n):
            scale = S[j, i] / S[i, i]
            for m in range(i, n):
                S[j, m] -= scale * S[i, m]
            x[j] -= scale * x[i]
    total: float = 0.0
    for i in range(n - 1, -1, -1):
        for m in range(i + 1, n):
            x[i] -= S[i, m] * x[m]
        x[i] /= S[i, i]
        total += r[i] * x[i]
    return total


@compiled
def largest_eigenvalue(S: Array, d: int) -> float:
    """Of the leading d x d part, d 2 or 3, of a symmetric S.

    Smith (1961), "Eigenvalues of a symmetric 3 x 3 matrix", for three.
    """
    if d == 2:
        half = 0.5 * (S[0, 0] - S[1, 1])
        larger: float = 0.5 * (S[0, 0] + S[1, 1]) + math.sqrt(half * half + S[0, 1] * S[0, 1])
        return larger
    mean: float = (S[0, 0] + S[1, 1] + S[2, 2]) / 3.0
    a, b, c = S[0, 0] - mean, S[1, 1] - mean, S[2, 2] - mean
    d01, d02, d12 = S[0, 1], S[0, 2], S[1, 2]
    square = (a * a + b * b + c * c + 2.0 * (d01 * d01 + d02 * d02 + d12 * d12)) / 6.0
    if not square > 0.0:
        return mean
    size = math.sqrt(square)
    det = a * (b * c - d12 * d12) - d01 * (d01 * c - d12 * d02) + d02 * (d01 * d12 - b * d02)
    cosine = min(1.0, max(-1.0, 0.5 * det / (square * size)))
    return mean + 2.0 * size * math.cos(math.acos(cosine) / 3.0)
