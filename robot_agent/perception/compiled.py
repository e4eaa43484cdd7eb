"""How the functions that see every pixel are compiled: into their caller, and only it is cached."""

from tagmap.geometry.kernels.compiled import NO_ENTRY, Function, entry, inlined, made
from tagmap.geometry.kernels.compiled import compiled as cached

__all__ = ["cached", "compiled", "inlined", "internal"]


def compiled(function: Function) -> Function:
    """For compiled functions to call; `cached` are those for Python to call."""
    return made(function, entry(function))


def internal(function: Function) -> Function:
    """As `compiled`, with no way in from Python."""
    return made(function, NO_ENTRY)
