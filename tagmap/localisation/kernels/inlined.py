"""Kernels that become part of their callers.

A call hands arrays over with their reference counts, which costs more than a small kernel itself;
where the call disappears the counting does. Kernels that are large stay `compiled`: each place
that they are copied to costs time to compile.
"""

from typing import cast

import numba

from tagmap.geometry.kernels.compiled import RELAXED, Function


def inlined(function: Function) -> Function:
    """`function`, compiled as `compiled` does it, into each kernel that calls it."""
    made = numba.njit(cache=True, error_model="numpy", fastmath=RELAXED, forceinline=True)(function)
    return cast(Function, made)
