"""A symmetric matrix of 3 x 3 blocks by pairs of tags: rows[n] >= columns[n], ascending.

Only the lower triangle is kept; blocks (P, 3, 3) with rows[n] == columns[n] are whole.
"""

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels.compiled import compiled


@compiled
def add_times(rows: Index, columns: Index, blocks: Array, x: Array, out: Array) -> None:
    """out (M, 3) += H x, of x (M, 3)."""
    n = 0
    while n < len(rows):
        i = rows[n]
        x0, x1, x2 = x[i, 0], x[i, 1], x[i, 2]
        y0 = y1 = y2 = 0.0
        while n < len(rows) and rows[n] == i:
            j = columns[n]
            a, b, c = blocks[n, 0, 0], blocks[n, 0, 1], blocks[n, 0, 2]
            d, e, f = blocks[n, 1, 0], blocks[n, 1, 1], blocks[n, 1, 2]
            g, h, k = blocks[n, 2, 0], blocks[n, 2, 1], blocks[n, 2, 2]
            u, v, w = x[j, 0], x[j, 1], x[j, 2]
            y0 += a * u + b * v + c * w
            y1 += d * u + e * v + f * w
            y2 += g * u + h * v + k * w
            if j != i:
                out[j, 0] += a * x0 + d * x1 + g * x2
                out[j, 1] += b * x0 + e * x1 + h * x2
                out[j, 2] += c * x0 + f * x1 + k * x2
            n += 1
        out[i, 0] += y0
        out[i, 1] += y1
        out[i, 2] += y2


@compiled
def add_sorted(a_key: Index, a: Array, b_key: Index, b: Array, key: Index, out: Array) -> int:
    """Blocks at the same key added up, into key and out (A + B, ...); their number.

    Both keys are ascending, and none occurs twice in either.
    """
    i = j = n = 0
    while i < len(a_key) or j < len(b_key):
        from_a = j == len(b_key) or (i < len(a_key) and a_key[i] <= b_key[j])
        from_b = i == len(a_key) or (j < len(b_key) and b_key[j] <= a_key[i])
        if from_a:
            key[n] = a_key[i]
            for r in range(3):
                for c in range(3):
                    out[n, r, c] = a[i, r, c]
            i += 1
        if from_b:
            key[n] = b_key[j]
            for r in range(3):
                for c in range(3):
                    out[n, r, c] = b[j, r, c] + (out[n, r, c] if from_a else 0.0)
            j += 1
        n += 1
    return n


@compiled
def turn(R: Array, blocks: Array, out: Array) -> None:
    """out = R B R' of every block."""
    for n in range(len(blocks)):
        for a in range(3):
            for b in range(3):
                total = 0.0
                for c in range(3):
                    half = 0.0
                    for e in range(3):
                        half += blocks[n, c, e] * R[b, e]
                    total += R[a, c] * half
                out[n, a, b] = total


@compiled
def add_dense(rows: Index, columns: Index, blocks: Array, out: Array) -> None:
    """out (n, n), its lower triangle, += the blocks."""
    for n in range(len(rows)):
        i, j = 3 * rows[n], 3 * columns[n]
        for a in range(3):
            for b in range(3):
                if i + a >= j + b:
                    out[i + a, j + b] += blocks[n, a, b]
