"""All assignments of spots to tags whose distances agree: a depth-first search, then the poses.

Spots are placed one after another. A tag for the next spot is looked up among the sorted neighbours
of a tag already placed, in the narrowest ring that a distance leaves, and has to agree with all
others placed. A spot may be skipped as foreign; an assignment skips exactly `skips` of them, so
that searches with 0, 1, 2, ... skips find different ones.
"""

from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.constellation.kernels.evidence import (
    Desk,
    lay,
    new_desk,
    refine,
    see,
)
from tagmap.localisation.constellation.kernels.sky import BUCKET_M, Chart, Sky
from tagmap.localisation.constellation.kernels.windows import order, windows

KEPT = 64
SKIPPED = -1
JUDGED = 25
"""To judge an assignment takes as long as to look at so many tags."""


class Found(NamedTuple):
    """The first KEPT assignments that pass: tag (K, N), SKIPPED for foreign; ln_evidence (K,);
    chi2 (K,); missed (K,): tags in the frame without a spot; T (K, 3, 4) of cam in map.
    """

    tag: Index
    ln_evidence: Array
    chi2: Array
    missed: Index
    T: Array


# Rows of `at` (5, N), where the search stands, by depth: the tag placed, the depth that the ring is
# about, the rest of the ring from and to, whether the spot was passed over.
_TAG, _ANCHOR, _NOW, _END, _PASSED_OVER = range(5)
# Layers of `limit` (5, N, N), by pair of depths: distances, their squares, the area of the ring.
_LOW, _HIGH, _LOW2, _HIGH2, _AREA = range(5)


@compiled
def new_found(n: int) -> Found:
    return Found(
        np.full((KEPT, n), SKIPPED),
        np.zeros(KEPT),
        np.zeros(KEPT),
        np.zeros(KEPT, dtype=np.int64),
        np.zeros((KEPT, 3, 4)),
    )


@compiled
def search(
    sky: Sky,
    chart: Chart,
    most_variance: float,
    sigmas: float,
    depth: int,
    skips: int,
    most_chi2: float,
    most_steps: int,
    found: Found,
) -> tuple[int, int, int]:
    """Fill `found` from the `depth` spots that tell most; how many passed, were tried, and steps.

    At least three are placed. Begins with every pair of tags at the distance of the first two that
    are. Ends early when more than KEPT pass, or with the tags that `most_steps` let it look at.
    """
    n = len(sky.p)
    rank = np.zeros(n, dtype=np.int64)
    limit = _limits(sky, most_variance, sigmas, rank)
    at = np.full((5, n), SKIPPED)
    # Hot functions get arrays, for a member of a tuple is counted as in use at every access.
    p, start, near, distance = chart.p, chart.start, chart.near, chart.distance
    pair, apart = chart.pair, chart.apart
    desk = new_desk(n)
    tag = np.full(n, SKIPPED)
    passed = tried = steps = int(np.int64(0))
    for first in range(skips + 1):
        for second in range(first + 1, skips + 2):
            at[_TAG, :second] = SKIPPED
            at_least, at_most = limit[_LOW, first, second], limit[_HIGH, first, second]
            for k in range(2 * np.searchsorted(apart, at_least), 2 * len(apart)):
                if apart[k // 2] > at_most or passed > KEPT or steps >= most_steps:
                    break
                at[_TAG, first], at[_TAG, second] = pair[k // 2, k % 2], pair[k // 2, 1 - k % 2]
                level, skipped = second + 1, second - 1
                steps += 1
                _open(at, limit, start, distance, level)
                while level > second and passed <= KEPT and steps < most_steps:
                    a = SKIPPED
                    if level - skipped < depth - skips:
                        a, looked = _next(at, limit, p, near, distance, level)
                        steps += looked
                    if a == SKIPPED:
                        if at[_PASSED_OVER, level] or skipped == skips:
                            level -= 1
                            if at[_TAG, level] == SKIPPED:
                                skipped -= 1
                            continue
                        at[_PASSED_OVER, level] = 1
                        skipped += 1
                    at[_TAG, level] = a
                    if level + 1 < depth:
                        level += 1
                        _open(at, limit, start, distance, level)
                        continue
                    tried += 1
                    steps += JUDGED
                    for i in range(depth):
                        tag[rank[i]] = at[_TAG, i]
                    if _judge(sky, chart, tag, most_chi2, desk, found, passed):
                        passed += 1
                    if a == SKIPPED:
                        skipped -= 1
    return passed, tried, steps


@compiled
def _limits(sky: Sky, most_variance: float, sigmas: float, rank: Index) -> Array:
    """`limit`, and the order of the spots in `rank` (N,)."""
    n = len(rank)
    low, high = np.zeros((n, n)), np.zeros((n, n))
    windows(sky, most_variance, sigmas, low, high)
    order(low, high, rank)
    limit = np.zeros((5, n, n))
    for i in range(n):
        for j in range(n):
            least, most = low[rank[i], rank[j]], high[rank[i], rank[j]]
            limit[_LOW, i, j], limit[_HIGH, i, j] = least, most
            limit[_LOW2, i, j], limit[_HIGH2, i, j] = least * least, most * most
            limit[_AREA, i, j] = most * most - least * least
    return limit


@compiled
def _open(at: Index, limit: Array, start: Index, distance: Array, level: int) -> None:
    """Set out the narrowest ring for the spot at `level` about a tag that is placed."""
    anchor, best = 0, np.inf
    for k in range(level):
        if at[_TAG, k] != SKIPPED and limit[_AREA, level, k] < best:
            best = limit[_AREA, level, k]
            anchor = k
    at[_PASSED_OVER, level] = 0
    at[_TAG, level] = SKIPPED
    at[_ANCHOR, level] = anchor
    a = at[_TAG, anchor]
    last = start.shape[1] - 1
    low = limit[_LOW, level, anchor]
    now, end = start[a, min(int(low / BUCKET_M), last)], start[a, last]
    while now < end and distance[now] < low:
        now += 1
    # Where the ring ends shows itself on the way.
    at[_NOW, level], at[_END, level] = now, end


@compiled
def _next(
    at: Index, limit: Array, p: Array, near: Index, distance: Array, level: int
) -> tuple[int, int]:
    """The next tag of the ring that agrees with all that are placed, or SKIPPED; tags looked at."""
    looked = 0
    most = limit[_HIGH, level, at[_ANCHOR, level]]
    for place in range(at[_NOW, level], at[_END, level]):
        if distance[place] > most:
            break
        looked += 1
        if _agrees(at, limit, p, level, near[place]):
            at[_NOW, level] = place + 1
            return near[place], looked
    at[_NOW, level] = at[_END, level]
    return SKIPPED, looked


@compiled
def _agrees(at: Index, limit: Array, p: Array, level: int, a: int) -> bool:
    for k in range(level):
        b = at[_TAG, k]
        if b == SKIPPED:
            continue
        if a == b:
            return False
        if k == at[_ANCHOR, level]:
            continue
        x, y, z = p[a, 0] - p[b, 0], p[a, 1] - p[b, 1], p[a, 2] - p[b, 2]
        square = x * x + y * y + z * z
        if square < limit[_LOW2, level, k] or square > limit[_HIGH2, level, k]:
            return False
    return True


@compiled
def _judge(
    sky: Sky, chart: Chart, tag: Index, most_chi2: float, desk: Desk, found: Found, place: int
) -> bool:
    """Whether one pose explains the assignment; it is kept at `place` while there is room."""
    if not lay(sky, chart, tag, desk):
        return False
    good, chi2, ln_evidence = refine(sky, chart, tag, 0.0, most_chi2, desk)
    if not good:
        return False
    if place < KEPT:
        found.tag[place] = tag
        found.ln_evidence[place] = ln_evidence
        found.chi2[place] = chi2
        found.missed[place] = _missed(sky, chart, tag, desk.T)
        found.T[place] = desk.T
    return True


@compiled
def _missed(sky: Sky, chart: Chart, tag: Index, T: Array) -> int:
    """Tags in the frame that no spot is assigned to; none, where the frame is unknown."""
    if len(sky.frame) == 0:
        return 0
    count = 0
    for a in range(len(chart.p)):
        x, y, z = see(chart, a, T)
        if not sky.frame[4] < z < sky.frame[5]:
            continue
        if not (
            sky.frame[0] * z < x < sky.frame[1] * z and sky.frame[2] * z < y < sky.frame[3] * z
        ):
            continue
        count += 1
        for i in range(len(tag)):
            if tag[i] == a:
                count -= 1
    return count
