"""Covariances between their wire form, row-wise upper triangles, and matrices."""

from functools import cache

import numpy as np

from tagmap.conventions import Array, Index


@cache
def _triangle(n: int) -> tuple[Index, Index]:
    return np.triu_indices(n)


def unpack_upper(values: Array, n: int) -> Array:
    """(..., n (n + 1) / 2) to symmetric (..., n, n)."""
    rows, columns = _triangle(n)
    cov = np.empty((*values.shape[:-1], n, n))
    cov[..., rows, columns] = values
    cov[..., columns, rows] = values
    return cov


def pack_upper(cov: Array) -> Array:
    """(..., n, n) to (..., n (n + 1) / 2)."""
    rows, columns = _triangle(cov.shape[-1])
    return cov[..., rows, columns]
