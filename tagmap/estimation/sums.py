"""Summing what belongs together."""

import numpy as np

from tagmap.conventions import Array, Index


def sum_by(index: Index, size: int, values: Array) -> Array:
    """Sum rows of `values` (K, ...) that share an `index` (K,): (size, ...)."""
    width = int(np.prod(values.shape[1:], dtype=int))
    flat = (index[:, None] * width + np.arange(width)).ravel()
    summed = np.bincount(flat, weights=values.ravel(), minlength=size * width)
    return summed.astype(np.float64, copy=False).reshape(size, *values.shape[1:])
