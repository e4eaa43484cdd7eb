"""A tag that is not where it was: what is condensed forgets it, not what it says of others."""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.condensed import Condensed

# Directions about which less is known than this part of the best do not count (the plane's z).
ROUNDING = 1e-12


def forgotten(condensed: Condensed, tags: Index) -> Condensed:
    """Without anything on `tags`, which are eliminated one by one: the marginal of the others."""
    for tag in tags.tolist():
        condensed = _without(condensed, tag)
    return condensed


def _without(condensed: Condensed, tag: int) -> Condensed:
    """H' = H - h D^-1 h', g' = g - h D^-1 g_tag, with D the tag's own block and h its column."""
    own = slice(3 * tag, 3 * tag + 3)
    H = condensed.information
    D = H[own, own].toarray()
    column = H[:, own].tocsr()
    others = np.setdiff1d(np.flatnonzero(np.diff(column.indptr)) // 3, [tag])
    rows = (3 * others[:, None] + np.arange(3)).ravel()
    h, a = column[rows].toarray(), condensed.across[tag]
    inverse = np.linalg.pinv(D, rcond=ROUNDING, hermitian=True)
    pull, across = condensed.pull.copy(), condensed.across.copy()
    g = pull[tag].copy()
    pull[others] -= (h @ inverse @ g).reshape(-1, 3)
    across[others] -= (h @ inverse @ a).reshape(len(others), 3, a.shape[1])
    pull[tag], across[tag] = 0.0, 0.0
    kept = (condensed.rows != tag) & (condensed.columns != tag)
    fill = _pairs(others, (h @ inverse @ h.T).reshape(len(others), 3, len(others), 3))
    rows, columns, blocks = _added(condensed, kept, *fill)
    return replace(
        condensed,
        rows=rows,
        columns=columns,
        blocks=blocks,
        across=across,
        corner=condensed.corner - a.T @ inverse @ a,
        pull=pull,
        calibration_pull=condensed.calibration_pull - a.T @ inverse @ g,
        cost=condensed.cost - float(g @ inverse @ g),
    )


def _pairs(tags: Index, blocks: Array) -> tuple[Index, Index, Array]:
    """The lower triangle of blocks (n, 3, n, 3), with the numbers of the tags (ascending)."""
    i, j = np.tril_indices(len(tags))
    return tags[i], tags[j], blocks[i, :, j, :]


def _added(
    condensed: Condensed, kept: Array, rows: Index, columns: Index, fill: Array
) -> tuple[Index, Index, Array]:
    """Blocks of pairs less what was eliminated."""
    pairs, at = np.unique(
        np.stack(
            [
                np.concatenate([condensed.rows[kept], rows]),
                np.concatenate([condensed.columns[kept], columns]),
            ]
        ),
        axis=1,
        return_inverse=True,
    )
    total = np.zeros((pairs.shape[1], 3, 3))
    np.add.at(total, at.ravel(), np.concatenate([condensed.blocks[kept], -fill]))
    return pairs[0], pairs[1], total
