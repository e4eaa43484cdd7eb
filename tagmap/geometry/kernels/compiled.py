"""How kernels are compiled, said once: on first use, kept on disk, IEEE division, other
threads go on meanwhile.

A kernel on disk is renewed when its own file changes, not when one that it calls does: after
editing a kernel delete the `__pycache__` folders.

It is compiled for each combination of types. A constant is a type of its own, as an argument too:
`bool(np.bool_(True))` and `int(np.int64(0))` are of the type that variables have. So is an array
that is read-only.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

# Sums may be reordered and fused, but NaN and infinity keep their meaning.
RELAXED = {"contract", "arcp", "nsz", "reassoc"}
OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": RELAXED}

# A way into a function is compiled with everything that it is given, once for C and once for
# Python: as long as a small function takes itself. For C none is made.
ENTRY: dict[str, Any] = {"no_cfunc_wrapper": True}
NO_ENTRY: dict[str, Any] = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True}


def compiled(function: Function) -> Function:
    """`function`, compiled for each combination of argument types that it is called with.

    One whose name begins with _ can be called by other compiled functions only.
    """
    return made(function, entry(function), cache=True, nogil=True)


def internal(function: Function) -> Function:
    """As `compiled`, for other compiled functions only."""
    return made(function, NO_ENTRY, cache=True, nogil=True)


def inlined(function: Function) -> Function:
    """`function`, written out in its callers: where a call would cost more than what it does.

    Arguments that are tuples of arrays make calls dear.
    """
    return made(function, NO_ENTRY, inline="always")


def entry(function: Function) -> dict[str, Any]:
    return NO_ENTRY if function.__name__.startswith("_") else ENTRY


def made(function: Function, way_in: dict[str, Any], **options: Any) -> Function:
    try:
        return cast(Function, numba.njit(**OPTIONS, **way_in, **options)(function))
    except RuntimeError:
        # No folder to keep anything in: each process compiles for itself.
        return cast(
            Function, numba.njit(**OPTIONS, **way_in, **options | {"cache": False})(function)
        )
