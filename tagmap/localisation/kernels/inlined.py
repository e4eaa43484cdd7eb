"""Kernels that become part of their callers.

A call hands arrays over with their reference counts, which costs more than a small kernel itself;
where the call disappears the counting does. Kernels that are large stay `compiled`: each place
that they are copied to costs time to compile.
"""

from tagmap.geometry.kernels.compiled import Function, entry, made


def inlined(function: Function) -> Function:
    """`function`, compiled as `compiled` does it, into each kernel that calls it."""
    return made(function, entry(function), cache=True, forceinline=True)
