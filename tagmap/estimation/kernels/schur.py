"""The reduced system itself, S = C - B' A^-1 B, as sparse as it is to rounding.

What a sighting says of a tag is carried along the chain from pose to pose and fades with every
further pose that is known by itself. Carried on until it has faded to nothing, it gives S exactly
to rounding, yet two tags meet only if they were seen within some poses of each other.
"""

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.kernels.chain import lever
from tagmap.estimation.kernels.layout import Linear
from tagmap.estimation.kernels.segments import add_coupling, add_product, carry
from tagmap.geometry.kernels.compiled import compiled

FULL_PAIRS, FULL_COLUMNS = -1, -2


@compiled
def reduce(
    linear: Linear,
    L: Array,
    D: Array,
    bounds: Index,
    faded: float,
    scale: Array,
    width: int,
    table: Index,
    rows: Index,
    columns: Index,
    blocks: Array,
    with_calibration: Array,
    calibration: Array,
) -> int:
    """Subtract B' A^-1 B, as blocks (P, 3, 3) of tag pairs rows[n] >= columns[n]; their number.

    L, D: factors of A. scale (M,): the size of each tag's own block; what is less than `faded` of
    it is dropped. width: tags carried at a time at most. table (H,): for hashing, all -1, H a power
    of 2 above 2 P. FULL_PAIRS or FULL_COLUMNS where the room does not do.
    with_calibration (M, 3, Q), calibration (Q, Q) are subtracted from in place.
    """
    slots = linear.pose_calibration.shape[2]
    size = slots + 3 * width
    Y, previous, Z = np.zeros((6, size)), np.zeros((6, size)), np.zeros((6, size))
    local = np.zeros((size, size))
    own = np.empty(width, dtype=np.int64)
    place = np.full(len(scale), -1, dtype=np.int64)
    m = n_pairs = int(np.int64(0))
    for g in range(len(bounds) - 1):
        begin, end = bounds[g], bounds[g + 1]
        for k in range(linear.first[begin], linear.first[end]):
            t = linear.tag[k]
            if place[t] < 0:
                if m == width:
                    return FULL_COLUMNS
                for a in range(6):
                    for b in range(3):
                        previous[a, slots + 3 * m + b] = 0.0
                place[t] = m
                own[m] = t
                m += 1
        used = slots + 3 * m
        local[:used, :used] = 0.0
        for i in range(begin, end):
            for a in range(6):
                for b in range(used):
                    Y[a, b] = 0.0
                for s in range(slots):
                    Y[a, s] = linear.pose_calibration[i, a, s]
            for k in range(linear.first[i], linear.first[i + 1]):
                t = linear.tag[k]
                q = lever(linear.p, t, linear.T, i)
                add_coupling(linear.seen, k, q, slots + 3 * place[t], Y)
            if i > 0:
                carry(L[i], previous, used, Y)
            add_product(D[i], Y, used, Z, local)
            Y, previous = previous, Y
        n_pairs = _add_pairs(
            local, slots, own[:m], len(scale), table, rows, columns, blocks, n_pairs
        )
        if n_pairs < 0:
            return FULL_PAIRS
        column = linear.slot_column[begin]
        for s in range(slots):
            if column[s] < 0:
                continue
            for n in range(m):
                for a in range(3):
                    with_calibration[own[n], a, column[s]] -= local[slots + 3 * n + a, s]
            for r in range(slots):
                if column[r] >= 0:
                    calibration[column[s], column[r]] -= local[max(s, r), min(s, r)]
        kept = 0
        for n in range(m):
            t, strength = own[n], 0.0
            for b in range(slots + 3 * n, slots + 3 * n + 3):
                for a in range(6):
                    strength += previous[a, b] * Z[a, b]
            place[t] = -1
            if strength > faded * scale[t]:
                for a in range(6):
                    for b in range(3):
                        previous[a, slots + 3 * kept + b] = previous[a, slots + 3 * n + b]
                place[t] = kept
                own[kept] = t
                kept += 1
        m = kept
    return n_pairs


@compiled
def _add_pairs(
    local: Array,
    slots: int,
    own: Index,
    n_tags: int,
    table: Index,
    rows: Index,
    columns: Index,
    blocks: Array,
    n_pairs: int,
) -> int:
    """Subtract the lower triangle `local` of one segment; the number of pairs, -1 if too many."""
    mask = len(table) - 1
    for n in range(len(own)):
        for j in range(n + 1):
            row, column = max(own[n], own[j]), min(own[n], own[j])
            at = ((row * n_tags + column) * 2654435761 >> 7) & mask
            while table[at] >= 0 and (rows[table[at]] != row or columns[table[at]] != column):
                at = (at + 1) & mask
            pair = table[at]
            if pair < 0:
                if n_pairs == len(rows):
                    return -1
                pair = table[at] = n_pairs
                rows[pair], columns[pair] = row, column
                blocks[pair, :, :] = 0.0
                n_pairs += 1
            x, y = slots + 3 * n, slots + 3 * j
            for a in range(3):
                for b in range(3):
                    if n == j:
                        blocks[pair, a, b] -= local[x + max(a, b), x + min(a, b)]
                    elif own[n] > own[j]:
                        blocks[pair, a, b] -= local[x + a, y + b]
                    else:
                        blocks[pair, b, a] -= local[x + a, y + b]
    return n_pairs


@compiled
def selected_inverse(indptr: Index, indices: Index, L: Array, d: Array, Z: Array) -> None:
    """Entries Z of (L diag(d) L')^-1 where L, unit lower in sorted CSC, has some, and its diagonal.

    Takahashi, Fagan, Chen, "Formation of a sparse bus impedance matrix" (1973). Z is laid out as L,
    whose columns begin with their diagonal.
    """
    n = len(d)
    sums = np.zeros(n)
    marked = np.full(n, -1, dtype=np.int64)
    for j in range(n - 1, -1, -1):
        begin, end = indptr[j], indptr[j + 1]
        for x in range(begin + 1, end):
            sums[indices[x]] = 0.0
            marked[indices[x]] = x
        for x in range(begin + 1, end):
            k, factor = indices[x], L[x]
            sums[k] += factor * Z[indptr[k]]
            for y in range(indptr[k] + 1, indptr[k + 1]):
                i = indices[y]
                at = marked[i]
                if at >= begin and at < end:
                    sums[i] += factor * Z[y]
                    sums[k] += L[at] * Z[y]
        total = 1.0 / d[j]
        for x in range(begin + 1, end):
            Z[x] = -sums[indices[x]]
            total -= L[x] * Z[x]
        Z[begin] = total


@compiled
def take_blocks(indptr: Index, indices: Index, Z: Array, place: Index, blocks: Array) -> None:
    """Diagonal blocks (M, 3, 3) out of a selected inverse; place (3 M,): where each row went."""
    for t in range(len(blocks)):
        for a in range(3):
            for b in range(a + 1):
                i, j = place[3 * t + a], place[3 * t + b]
                low, high = min(i, j), max(i, j)
                for at in range(indptr[low], indptr[low + 1]):
                    if indices[at] == high:
                        blocks[t, a, b] = blocks[t, b, a] = Z[at]


@compiled
def pose_inverse_blocks(L: Array, D: Array, out: Array) -> None:
    """out (N, 6, 6): the diagonal blocks of A^-1."""
    n = len(D)
    for i in range(n - 1, -1, -1):
        for a in range(6):
            for b in range(6):
                out[i, a, b] = D[i, a, b]
        if i + 1 == n:
            continue
        for a in range(6):
            for e in range(6):
                half = 0.0
                for c in range(6):
                    half += L[i + 1, c, a] * out[i + 1, c, e]
                for b in range(6):
                    out[i, a, b] += half * L[i + 1, e, b]
