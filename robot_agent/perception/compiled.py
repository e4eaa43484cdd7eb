"""How the functions that see every pixel are compiled: into their caller, and only it is cached."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

# Sums may be reordered and fused, but NaN and infinity keep their meaning.
_RELAXED = {"contract", "arcp", "nsz", "reassoc"}


def compiled(function: Function) -> Function:
    """For compiled functions to call."""
    return cast(Function, numba.njit(error_model="numpy", fastmath=_RELAXED)(function))


def inlined(function: Function) -> Function:
    """As `compiled`, for a function whose arguments take as long to pass as its work."""
    made = numba.njit(error_model="numpy", fastmath=_RELAXED, inline="always")(function)
    return cast(Function, made)


def cached(function: Function) -> Function:
    """As `compiled`, for Python to call; kept on disk, where the next process finds it."""
    return cast(Function, numba.njit(error_model="numpy", fastmath=_RELAXED, cache=True)(function))
