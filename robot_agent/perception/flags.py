"""What can be said against a bright spot, by name."""

from enum import IntFlag


class Flag(IntFlag):
    """saturated  clipped at full scale; placed by its unclipped pixels
    merged        overlaps another one; placed jointly with it
    border        cut by the edge of the image; placed by what is left
    oversized     wider than a tag: a lamp, a window, the sun on a wall
    hot_pixel     narrower than the optics can image: one bad pixel
    elongated     a streak, a reflection, or two spots too close to be told apart
    misfit        of no shape that a tag has
    """

    SATURATED = 1
    MERGED = 2
    BORDER = 4
    OVERSIZED = 8
    HOT_PIXEL = 16
    ELONGATED = 32
    MISFIT = 64


REFUSED = Flag.OVERSIZED | Flag.HOT_PIXEL | Flag.ELONGATED | Flag.MISFIT
"""No tag looks like that."""


def names(flags: int) -> list[str]:
    """In lower case, in the order above."""
    return [str(flag.name).lower() for flag in Flag if flag & flags]
