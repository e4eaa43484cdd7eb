"""Arrays of any batch shape as compiled code takes them."""

from typing import Any

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array


def rows(x: npt.NDArray[Any], *shape: int) -> Array:
    """(..., *shape) as (N, *shape) without gaps; no shape: that of vectors, (..., n) as (N, n)."""
    return np.ascontiguousarray(x, dtype=np.float64).reshape(-1, *(shape or x.shape[-1:]))
