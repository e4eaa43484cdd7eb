"""The middle of the mirror angles that light a tag: two lines of shots, one across the other.

First along x of laser through where the beam was aimed at, then along z through the middle of what
was lit: the middle of any chord of a disc is abreast of the disc's middle.
"""

import numpy as np

from tagmap.conventions import Array, Mask


def line(axis: int, through_m: Array, spacing_m: float, n: int) -> Array:
    """Offsets (2 n + 1, 2) in m for geometry.scanner.aiming.beside: n to each side of through_m
    (2,), along x (axis 0) or z (1)."""
    offsets_m = np.tile(through_m, (2 * n + 1, 1)).astype(np.float64)
    offsets_m[:, axis] += spacing_m * np.arange(-n, n + 1)
    return offsets_m


def middle(offsets_m: Array, lit: Mask) -> Array | None:
    """(2,) in m of a line (K, 2) of which `lit` (K,) lit the tag; None unless dark shots bracket
    lit ones: then the line is too short, or misses."""
    which = np.flatnonzero(lit)
    if not len(which) or which[0] == 0 or which[-1] == len(lit) - 1:
        return None
    centre: Array = 0.5 * (offsets_m[which[0]] + offsets_m[which[-1]])
    return centre


def sigma_middle_m(spacing_m: float) -> float:
    """Of each coordinate: both edges are anywhere within one spacing."""
    return float(spacing_m / np.sqrt(24.0))
