"""The preconditioner: what short segments of the chains say of the tags, links between them cut."""

from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.kernels.calibration import slot_of
from tagmap.estimation.kernels.chain import invert, lever
from tagmap.estimation.kernels.layout import Linear, Short
from tagmap.estimation.kernels.motion import position_of
from tagmap.estimation.kernels.small import (
    M,
    V,
    cross,
    full,
    hat_times,
    subtract,
    sum_of,
    times_hat,
)
from tagmap.geometry.kernels.compiled import compiled, internal

# What is cut off from everything else still needs an inverse.
_REGULAR = 1e-9


@compiled
def cut(
    first: Index, slot_column: Index, row: Index, sightings: int, poses: int, bounds: Index
) -> int:
    """Bounds (G + 1,) of segments that end after so many sightings or poses; returns G.

    All poses of a segment have the same slots. row (N - 1,): of steps, chains end where it is -1.
    """
    n, begin = 0, 0
    bounds[0] = 0
    for i in range(1, len(first)):
        full = first[i] - first[begin] >= sightings or i - begin >= poses
        last = i == len(first) - 1 or row[i - 1] < 0
        if full or last or _differs(slot_column[i], slot_column[i - 1]):
            n += 1
            bounds[n] = begin = i
    return n


@compiled
def _differs(a: Index, b: Index) -> bool:
    return bool((a != b).any())


@compiled
def incidence(
    first: Index, tag: Short, bounds: Index, n_tags: int, start: Index, tags: Index
) -> int:
    """Distinct tags of each segment, as CSR: start (G + 1,), tags (K,) or less."""
    last = np.full(n_tags, -1, dtype=np.int64)
    n = 0
    for g in range(len(start) - 1):
        start[g] = n
        for k in range(first[bounds[g]], first[bounds[g + 1]]):
            t = tag[k]
            if last[t] != g:
                last[t] = g
                tags[n] = t
                n += 1
    start[len(start) - 1] = n
    return n


@compiled
def places(start: Index, tags: Index, indptr: Index, indices: Index, place: Index) -> None:
    """Where in BSR each pair of tags of a segment is: place (sum m (m + 1) / 2,), pairs j <= n."""
    at = 0
    for g in range(len(start) - 1):
        for n in range(start[g], start[g + 1]):
            for j in range(start[g], n + 1):
                row, column = max(tags[n], tags[j]), min(tags[n], tags[j])
                low, high = indptr[row], indptr[row + 1]
                while high - low > 1:
                    middle = (low + high) // 2
                    if indices[middle] <= column:
                        low = middle
                    else:
                        high = middle
                place[at] = low
                at += 1


@compiled
def arrange(start: Index, tags: Index, position: Index) -> None:
    """Number tags (M,) by breadth from one end, so that those of a segment have near numbers.

    Cuthill, McKee, "Reducing the bandwidth of sparse symmetric matrices" (1969), on the segments
    themselves instead of on pairs of tags.
    """
    n_tags = len(position)
    begin = np.zeros(n_tags + 1, dtype=np.int64)
    for t in tags:
        begin[t + 1] += 1
    for t in range(n_tags):
        begin[t + 1] += begin[t]
    fill, of = begin[:-1].copy(), np.empty(len(tags), dtype=np.int64)
    for g in range(len(start) - 1):
        for n in range(start[g], start[g + 1]):
            of[fill[tags[n]]] = g
            fill[tags[n]] += 1
    queue, reached = np.empty(n_tags, dtype=np.int64), np.zeros(n_tags, dtype=np.int64)
    used = np.zeros(len(start), dtype=np.int64)
    done = round_ = 0
    for root in range(n_tags):
        if reached[root] > 0:
            continue
        # The tag that is reached last lies at an end: there the numbers begin.
        for _ in range(2):
            round_ += 1
            queue[done], reached[root], end = root, round_, done + 1
            at = done
            while at < end:
                t = queue[at]
                at += 1
                for m in range(begin[t], begin[t + 1]):
                    g = of[m]
                    if used[g] == round_:
                        continue
                    used[g] = round_
                    for n in range(start[g], start[g + 1]):
                        if reached[tags[n]] != round_:
                            reached[tags[n]] = round_
                            queue[end] = tags[n]
                            end += 1
            root = queue[end - 1]
        done = end
    for n in range(n_tags):
        position[queue[n]] = n


@compiled
def spread(start: Index, tags: Index, position: Index) -> int:
    """How far apart two tags of a segment are numbered at most."""
    widest = 0
    for g in range(len(start) - 1):
        low, high = len(position), -1
        for n in range(start[g], start[g + 1]):
            low, high = min(low, position[tags[n]]), max(high, position[tags[n]])
        widest = max(widest, high - low)
    return widest


@compiled
def add_pairs(rows: Index, columns: Index, blocks: Array, position: Index, band: Array) -> None:
    """Add blocks (P, 3, 3) of pairs of tags to the lower band: see Into."""
    for n in range(len(rows)):
        row, column = 3 * position[rows[n]], 3 * position[columns[n]]
        for a in range(3):
            for b in range(3):
                i, j = row + a, column + b
                if row > column or (row == column and a >= b):
                    band[j, i - j] += blocks[n, a, b]
                elif row < column:
                    band[i, j - i] += blocks[n, a, b]


class Into(NamedTuple):
    """Where sums over segments go: into a band, or if that is empty into blocks of pairs of tags.

    position (M,): where each tag comes in the band (3 M, width + 1): row j holds, from the diagonal
    down, column j of the matrix. place: of each segment's pairs in blocks (B, 3, 3), of BSR.
    """

    position: Index
    band: Array
    place: Index
    blocks: Array


@compiled
def eliminate(
    linear: Linear,
    bounds: Index,
    damping: float,
    start: Index,
    tags: Index,
    into: Into,
    with_calibration: Array,
    calibration: Array,
) -> bool:
    """Subtract the Schur complement of every segment from the lower triangle `into`.

    with_calibration (M, 3, Q), calibration (Q, Q). False where a pose is not determined.
    """
    T = linear.T
    n_poses, slots = len(linear.diagonal), linear.pose_calibration.shape[2]
    widest = 0
    for g in range(len(start) - 1):
        widest = max(widest, start[g + 1] - start[g])
    width = widest * 3 + slots
    local_of = np.full(len(linear.tag_diagonal), -1, dtype=np.int64)
    Y, Z, previous = np.zeros((6, width)), np.zeros((6, width)), np.zeros((6, width))
    local = np.zeros((width, width))
    S, D, L = np.empty((6, 6)), np.empty((6, 6)), np.empty((6, 6))
    at_place = int(np.int64(0))
    for g in range(len(start) - 1):
        m = start[g + 1] - start[g]
        begin, end = bounds[g], bounds[g + 1]
        for n in range(m):
            local_of[tags[start[g] + n]] = n
        used, columns = slots, slots + m * 3
        local[:columns, :columns] = 0.0
        Y[:, :columns] = 0.0
        previous[:, :columns] = 0.0
        for i in range(begin, end):
            S[:, :] = linear.diagonal[i]
            if i == begin and i > 0:
                q = subtract(position_of(T[i]), position_of(T[i - 1]))
                _without_link_before(linear.following[i - 1], q, S)
            if i == end - 1 and i + 1 < n_poses:
                q = subtract(position_of(T[i + 1]), position_of(T[i]))
                _without_link_after(linear.following[i], q, S)
            for a in range(6):
                S[a, a] += damping * max(S[a, a], 1.0) + _REGULAR * linear.diagonal[i, a, a]
            for k in range(linear.first[i], linear.first[i + 1]):
                used = max(used, slots + (local_of[linear.tag[k]] + 1) * 3)
            for a in range(6):
                for b in range(used):
                    Y[a, b] = 0.0
                for s in range(slots):
                    Y[a, s] = linear.pose_calibration[i, a, s]
            if linear.step_column.shape[1] > 0:
                if i == begin and i > 0:
                    _without_calibration_before(linear, i, Y, calibration)
                if i == end - 1 and i + 1 < n_poses:
                    q = subtract(position_of(T[i + 1]), position_of(T[i]))
                    _without_calibration_after(linear, i, q, Y)
            for k in range(linear.first[i], linear.first[i + 1]):
                t = linear.tag[k]
                q = lever(linear.p, t, linear.T, i)
                add_coupling(linear.seen, k, q, slots + local_of[t] * 3, Y)
            if i > begin:
                link = linear.following[i - 1]
                for a in range(6):
                    for b in range(6):
                        sum_ = 0.0
                        for e in range(6):
                            sum_ += link[a, e] * D[e, b]
                        L[a, b] = sum_
                for a in range(6):
                    for b in range(6):
                        sum_ = 0.0
                        for e in range(6):
                            sum_ += L[a, e] * link[b, e]
                        S[a, b] -= sum_
                carry(L, previous, used, Y)
            if not invert(S, D):
                return False
            add_product(D, Y, used, Z, local)
            Y, previous = previous, Y
        own = tags[start[g] : start[g + 1]]
        if len(into.band):
            _spread_band(local, slots, own, into.position, into.band)
        else:
            at_place = _spread(local, slots, own, into.place, at_place, into.blocks)
        _spread_calibration(
            local, slots, own, linear.slot_column[begin], with_calibration, calibration
        )
    return True


@internal
def carry(L: Array, previous: Array, used: int, Y: Array) -> None:
    """Y (6, used) -= L previous."""
    for a in range(6):
        for b in range(used):
            Y[a, b] -= (
                L[a, 0] * previous[0, b]
                + L[a, 1] * previous[1, b]
                + L[a, 2] * previous[2, b]
                + L[a, 3] * previous[3, b]
                + L[a, 4] * previous[4, b]
                + L[a, 5] * previous[5, b]
            )


@internal
def add_product(D: Array, Y: Array, used: int, Z: Array, local: Array) -> None:
    """local (used, used), its lower triangle, += Y' D Y; Z (6, used) = D Y."""
    for a in range(6):
        for b in range(used):
            Z[a, b] = (
                D[a, 0] * Y[0, b]
                + D[a, 1] * Y[1, b]
                + D[a, 2] * Y[2, b]
                + D[a, 3] * Y[3, b]
                + D[a, 4] * Y[4, b]
                + D[a, 5] * Y[5, b]
            )
    for a in range(used):
        y0, y1, y2, y3, y4, y5 = Y[0, a], Y[1, a], Y[2, a], Y[3, a], Y[4, a], Y[5, a]
        for b in range(a + 1):
            local[a, b] += (
                y0 * Z[0, b]
                + y1 * Z[1, b]
                + y2 * Z[2, b]
                + y3 * Z[3, b]
                + y4 * Z[4, b]
                + y5 * Z[5, b]
            )


@internal
def add_coupling(seen: Array, k: int, q: V, at: int, Y: Array) -> None:
    """What a tag does to its pose: -W, -hat(q) W, into columns at..at + 2 of Y (6, ...)."""
    W = full((seen[k, 0], seen[k, 1], seen[k, 2], seen[k, 3], seen[k, 4], seen[k, 5]))
    turned = hat_times(q, W)
    for a in range(3):
        for b in range(3):
            Y[a, at + b] -= W[3 * a + b]
            Y[3 + a, at + b] -= turned[3 * a + b]


@compiled
def _block(A: Array, row: int, column: int) -> M:
    return (
        A[row, column],
        A[row, column + 1],
        A[row, column + 2],
        A[row + 1, column],
        A[row + 1, column + 1],
        A[row + 1, column + 2],
        A[row + 2, column],
        A[row + 2, column + 1],
        A[row + 2, column + 2],
    )


@compiled
def _without_link_before(following: Array, q: V, S: Array) -> None:
    """Take the link with the pose before out of S: following = -K [[I, -hat(q)], [0, I]]."""
    for row in (0, 3):
        left = _block(following, row, 0)
        right = sum_of(_block(following, row, 3), times_hat(left, q))
        for a in range(3):
            for b in range(3):
                S[row + a, b] += left[3 * a + b]
                S[row + a, 3 + b] += right[3 * a + b]


@compiled
def _without_link_after(following: Array, q: V, S: Array) -> None:
    """Take the link with the pose after out of S: [[I, 0], [hat(q), I]] following is less of it."""
    for column in (0, 3):
        top = _block(following, 0, column)
        low = sum_of(_block(following, 3, column), hat_times(q, top))
        for a in range(3):
            for b in range(3):
                S[a, column + b] += top[3 * a + b]
                S[3 + a, column + b] += low[3 * a + b]


@compiled
def _without_calibration_before(linear: Linear, i: int, Y: Array, calibration: Array) -> None:
    """Take what the step to pose i says of its own unknowns out of Y, and out of these."""
    columns = linear.step_column[i - 1]
    for u in range(2):
        if columns[u] < 0:
            continue
        slot = slot_of(linear, i, columns[u])
        for a in range(6):
            Y[a, slot] -= linear.step_calibration[i - 1, a, u]
        for v in range(2):
            if columns[v] >= 0:
                calibration[columns[u], columns[v]] -= linear.step_corner[i - 1, u, v]


@compiled
def _without_calibration_after(linear: Linear, i: int, q: V, Y: Array) -> None:
    """Take what the step from pose i says of its own unknowns out of Y."""
    for u in range(2):
        column = linear.step_column[i, u]
        if column < 0:
            continue
        slot, h = slot_of(linear, i, column), linear.step_calibration[i, :, u]
        turned = cross(q, (h[0], h[1], h[2]))
        for a in range(3):
            Y[a, slot] += h[a]
            Y[3 + a, slot] += h[3 + a] + turned[a]


@compiled
def _spread(local: Array, slots: int, tags: Index, place: Index, at: int, blocks: Array) -> int:
    """Subtract the lower triangle `local` of one segment from the sums over all."""
    for n in range(len(tags)):
        for j in range(n + 1):
            block, x, y = place[at], slots + 3 * n, slots + 3 * j
            at += 1
            if n == j:
                for a in range(3):
                    for b in range(a + 1):
                        blocks[block, a, b] -= local[x + a, x + b]
                        if a != b:
                            blocks[block, b, a] -= local[x + a, x + b]
            elif tags[n] > tags[j]:
                for a in range(3):
                    for b in range(3):
                        blocks[block, a, b] -= local[x + a, y + b]
            else:
                for a in range(3):
                    for b in range(3):
                        blocks[block, b, a] -= local[x + a, y + b]
    return at


@compiled
def _spread_band(local: Array, slots: int, tags: Index, position: Index, band: Array) -> None:
    """The same, from a band."""
    for n in range(len(tags)):
        for j in range(n + 1):
            row, column = 3 * position[tags[n]], 3 * position[tags[j]]
            x, y = slots + 3 * n, slots + 3 * j
            if n == j:
                for a in range(3):
                    for b in range(a + 1):
                        band[row + b, a - b] -= local[x + a, x + b]
            elif row > column:
                for b in range(3):
                    for a in range(3):
                        band[column + b, row + a - column - b] -= local[x + a, y + b]
            else:
                for a in range(3):
                    for b in range(3):
                        band[row + a, column + b - row - a] -= local[x + a, y + b]


@compiled
def _spread_calibration(
    local: Array,
    slots: int,
    tags: Index,
    column: Index,
    with_calibration: Array,
    calibration: Array,
) -> None:
    for s in range(slots):
        if column[s] < 0:
            continue
        for n in range(len(tags)):
            for a in range(3):
                with_calibration[tags[n], a, column[s]] -= local[slots + 3 * n + a, s]
        for r in range(slots):
            if column[r] >= 0:
                calibration[column[s], column[r]] -= local[max(s, r), min(s, r)]
