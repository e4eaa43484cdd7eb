"""How the functions that see every pixel are compiled: into their caller, and only it is cached."""

from typing import cast

import numba

from tagmap.geometry.kernels.compiled import RELAXED, Function
from tagmap.geometry.kernels.compiled import compiled as cached

__all__ = ["cached", "compiled", "inlined"]


def compiled(function: Function) -> Function:
    """For compiled functions to call; `cached` are those for Python to call."""
    return cast(Function, numba.njit(error_model="numpy", fastmath=RELAXED)(function))


def inlined(function: Function) -> Function:
    """As `compiled`, for a function whose arguments take as long to pass as its work."""
    made = numba.njit(error_model="numpy", fastmath=RELAXED, inline="always")(function)
    return cast(Function, made)
