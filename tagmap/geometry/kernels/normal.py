"""Normal equations of six unknowns: Cholesky without pivoting, in place, no allocation."""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled

# Below this share of its diagonal a pivot is rounding: the direction is open.
_RELATIVE_PIVOT = 1e-13


@compiled
def factor(H: Array, damping: float, L: Array) -> bool:
    """L (6, 6) lower with L L^T = H + damping diag(H); False where H is not positive definite.

    The diagonal of L holds the inverses of the pivots' roots.
    """
    for i in range(6):
        for j in range(i):
            s = H[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s * L[j, j]
        s = H[i, i] * (1.0 + damping)
        for k in range(i):
            s -= L[i, k] * L[i, k]
        if not s > _RELATIVE_PIVOT * H[i, i]:
            return False
        L[i, i] = 1.0 / math.sqrt(s)
    return True


@compiled
def solve(L: Array, g: Array, x: Array) -> None:
    """x = (L L^T)^-1 g."""
    for i in range(6):
        s = g[i]
        for k in range(i):
            s -= L[i, k] * x[k]
        x[i] = s * L[i, i]
    for back in range(6):
        i = 5 - back
        s = x[i]
        for k in range(i + 1, 6):
            s -= L[k, i] * x[k]
        x[i] = s * L[i, i]


@compiled
def inverse(L: Array, scratch: Array, cov: Array) -> None:
    """cov (6, 6) = (L L^T)^-1; scratch (6, 6) takes L^-1."""
    for j in range(6):
        scratch[j, j] = L[j, j]
        for i in range(j + 1, 6):
            s = 0.0
            for k in range(j, i):
                s -= L[i, k] * scratch[k, j]
            scratch[i, j] = s * L[i, i]
    for i in range(6):
        for j in range(i + 1):
            s = 0.0
            for k in range(i, 6):
                s += scratch[k, i] * scratch[k, j]
            cov[i, j] = cov[j, i] = s
