"""How kernels are compiled, said once: on first use, kept on disk, IEEE division, other
threads go on meanwhile.

A kernel on disk is renewed when its own file changes, not when one that it calls does: after
editing a kernel delete the `__pycache__` folders.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

# Sums may be reordered and fused, but NaN and infinity keep their meaning.
RELAXED = {"contract", "arcp", "nsz", "reassoc"}


def compiled(function: Function) -> Function:
    """`function`, compiled for each combination of argument types that it is called with."""
    made = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=RELAXED)(function)
    return cast(Function, made)


def inlined(function: Function) -> Function:
    """`function`, written out in its callers: where a call would cost more than what it does.

    Arguments that are tuples of arrays make calls dear.
    """
    made = numba.njit(inline="always", error_model="numpy", fastmath=RELAXED)(function)
    return cast(Function, made)
