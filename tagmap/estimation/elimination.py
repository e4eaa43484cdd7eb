"""All poses eliminated: what they say of the tags, as sparse as it is."""

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.kernels import schur, segments
from tagmap.estimation.kernels.layout import Linear
from tagmap.estimation.preconditioner import SEGMENT_POSES, SEGMENT_SIGHTINGS

FADED = 1e-22
FIRST_WIDTH = 256
FIRST_PAIRS = 64


def eliminated(
    linear: Linear, L: Array, D: Array, between: Array, corner: Array
) -> tuple[Index, Index, Array]:
    """-B' A^-1 B by pairs of tags: rows >= columns (P,), blocks (P, 3, 3).

    L, D: the factors of A. Its parts with calibration unknowns are added to between (M, 3, Q) and
    corner (Q, Q). Exact but for what has faded to FADED of a tag's own block: the root of that is
    the error of pairs, and must be nothing to rigid motions of all tags, of which nothing is known.
    """
    n_tags = len(linear.tag_diagonal)
    bounds = np.zeros(len(linear.first), dtype=np.int64)
    linked = np.zeros(len(linear.following), dtype=np.int64)
    count = segments.cut(
        linear.first, linear.slot_column, linked, SEGMENT_SIGHTINGS, SEGMENT_POSES, bounds
    )
    scale = np.trace(linear.tag_diagonal, axis1=1, axis2=2)
    room, width = FIRST_PAIRS * (n_tags + 1), min(n_tags, FIRST_WIDTH)
    while True:
        table = np.full(1 << int(2 * room).bit_length(), -1, dtype=np.int64)
        rows, columns = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
        blocks = np.empty((room, 3, 3))
        with_calibration, calibration = between.copy(), corner.copy()
        n = schur.reduce(
            linear,
            L,
            D,
            bounds[: count + 1],
            FADED,
            scale,
            width,
            table,
            rows,
            columns,
            blocks,
            with_calibration,
            calibration,
        )
        if n >= 0:
            between[:], corner[:] = with_calibration, calibration
            return rows[:n], columns[:n], blocks[:n]
        room, width = (2 * room, width) if n == schur.FULL_PAIRS else (room, 2 * width)
