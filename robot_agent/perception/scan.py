"""Where an image may hold a spot: compiled, one pass over all pixels.

An image without anything bright costs little more than reading it: eight bytes at a time are
compared with the threshold of their tile, and only a block that holds something above it is looked
at pixel by pixel.
"""

from typing import Any

import numpy as np

from robot_agent.perception.compiled import compiled, inlined
from tagmap.conventions import Array, Index

TILE_BYTES = 256
TILE_ROWS = 128
BAND_ROWS = 8
"""Rows that are compared at once; divides TILE_ROWS."""

_WORDS = TILE_BYTES // 8
_PLACES = 5
_RUN_PX = 16
_LEAST_VARIANCE = 1.0 / 12.0
_OUTLIER = 3.0
"""A variance of 15 degrees of freedom is as many times its mean once in ten thousand."""


@compiled
def survey(image: Any) -> tuple[Array, float]:
    """Background (tile rows, tile columns) and the variance of its noise, in grey levels.

    A tile's background is the median of five runs of sixteen pixels, so neither spots nor a lamp
    that covers two of them move it. Noise is the scatter within runs, those with an edge left out.
    """
    height, width = image.shape
    tile_px = TILE_BYTES // image.itemsize
    rows, columns = -(-height // TILE_ROWS), -(-width // tile_px)
    background = np.empty((rows, columns))
    scatter = np.empty(rows * columns * _PLACES)
    means = np.empty(_PLACES)
    calm = 0.0
    n = 0
    for row in range(rows):
        top = row * TILE_ROWS
        step_y = min(TILE_ROWS, height - top) // 8
        for column in range(columns):
            left = column * tile_px
            step_x = max(min(tile_px, width - left) - _RUN_PX, 0) // 4
            least = np.inf
            for place in range(_PLACES):
                # A quincunx: four corners and the centre.
                y = top + step_y * (4 if place == 4 else 2 if place < 2 else 6)
                x = min(left + step_x * (2 if place == 4 else 1 + 2 * (place % 2)), width - _RUN_PX)
                total, square = np.int64(0), np.int64(0)
                run = image[y, x : x + _RUN_PX]
                for i in range(_RUN_PX):
                    value = np.int64(run[i])
                    total += value
                    square += value * value
                variance = (square - total * total / _RUN_PX) / (_RUN_PX - 1)
                scatter[n] = variance
                least = min(least, variance)
                n += 1
                _insert(means, place, total / _RUN_PX)
            calm += least
            background[row, column] = means[_PLACES // 2]
    return background, _without_outliers(scatter, 1.6 * calm / (rows * columns))


@compiled
def _insert(ordered: Array, n: int, value: float) -> None:
    """Put `value` into its place among the first n numbers, which are in ascending order."""
    while n > 0 and ordered[n - 1] > value:
        ordered[n] = ordered[n - 1]
        n -= 1
    ordered[n] = value


@compiled
def _without_outliers(values: Array, mean: float) -> float:
    """Mean of `values` up to 3 times itself, from a first guess of it."""
    for _ in range(3):
        limit = _OUTLIER * max(mean, _LEAST_VARIANCE)
        total, n = 0.0, 0.0
        for value in values:
            total += value if value <= limit else 0.0
            n += 1.0 if value <= limit else 0.0
        mean = total / max(n, 1.0)
    return max(mean, _LEAST_VARIANCE)


@compiled
def peaks(image: Any, words: Any, background: Array, excess: float, found: Index) -> int:
    """Rows and columns of 5x5 maxima that exceed their background by `excess`, into found (n, 2).

    image (height, width); words (height, n): the same memory, eight bytes each, possibly with a
    margin on the right. Returns how many there are, which may be more than `found` holds.
    """
    height, columns = image.shape[0], background.shape[1]
    lanes = 8 // image.itemsize
    high = np.uint64(0x8080808080808080 if lanes == 8 else 0x8000800080008000)
    tests = _tests(background, excess, 64 // lanes, high)
    bright, marked = np.empty(columns, np.uint64), np.empty(_WORDS, np.uint64)
    n = 0
    for top in range(0, height, BAND_ROWS):
        test = tests[top // TILE_ROWS]
        _mark_tiles(words, top, test, ~high, bright)
        for column in range(columns):
            if bright[column] & high:
                n = _peaks_of_block(image, words, top, column, test[column], high, marked, found, n)
    return n


@compiled
def _tests(background: Array, excess: float, bits: int, high: Any) -> Any:
    """Of each tile (rows, columns, 3): what _above needs, and the threshold itself.

    A lane is at or above the threshold when adding the complement carries into its high bit. The
    sum is made without the high bits, which are then put back: where the threshold has none, a
    high bit in the lane `or` in the sum decides, else it has to be in both.
    """
    tests = np.empty((*background.shape, 3), np.uint64)
    ones = high >> np.uint64(bits - 1)
    for row in range(background.shape[0]):
        for column in range(background.shape[1]):
            # Full scale itself is always bright enough.
            threshold = min(int(background[row, column] + excess) + 1, (1 << bits) - 1)
            small = threshold <= 1 << (bits - 1)
            tests[row, column, 0] = ones * np.uint64(
                (1 << (bits - 1 if small else bits)) - threshold
            )
            tests[row, column, 1] = ~np.uint64(0) if small else np.uint64(0)
            tests[row, column, 2] = threshold
    return tests


@inlined
def _above(word: Any, low: Any, add: Any, either: Any) -> Any:
    """Has the high bit of those lanes set that are at or above the threshold; others anyhow."""
    return (((word & low) + add) | (word & either)) & (word | either)


@compiled
def _mark_tiles(words: Any, top: int, test: Any, low: Any, bright: Any) -> None:
    """Which tiles of a band hold something at or above their threshold."""
    last = words.shape[0] - 1
    r0, r1 = words[top], words[min(top + 1, last)]
    r2, r3 = words[min(top + 2, last)], words[min(top + 3, last)]
    r4, r5 = words[min(top + 4, last)], words[min(top + 5, last)]
    r6, r7 = words[min(top + 6, last)], words[min(top + 7, last)]
    for column in range(len(bright)):
        add, either = test[column, 0], test[column, 1]
        # The last tile may reach back into the one before, so that all are of one length.
        start = min(column * _WORDS, words.shape[1] - _WORDS)
        s0, s1 = r0[start : start + _WORDS], r1[start : start + _WORDS]
        s2, s3 = r2[start : start + _WORDS], r3[start : start + _WORDS]
        s4, s5 = r4[start : start + _WORDS], r5[start : start + _WORDS]
        s6, s7 = r6[start : start + _WORDS], r7[start : start + _WORDS]
        hit = np.uint64(0)
        for k in range(_WORDS):
            hit |= _above(s0[k], low, add, either) | _above(s1[k], low, add, either)
            hit |= _above(s2[k], low, add, either) | _above(s3[k], low, add, either)
            hit |= _above(s4[k], low, add, either) | _above(s5[k], low, add, either)
            hit |= _above(s6[k], low, add, either) | _above(s7[k], low, add, either)
        bright[column] = hit


@compiled
def _peaks_of_block(
    image: Any,
    words: Any,
    top: int,
    column: int,
    test: Any,
    high: Any,
    marked: Any,
    found: Index,
    n: int,
) -> int:
    """Add the peaks of one tile's part of a band to the n that there are."""
    bottom = min(top + BAND_ROWS, words.shape[0])
    start = min(column * _WORDS, words.shape[1] - _WORDS)
    lanes = 8 // image.itemsize
    add, either = test[0], test[1]
    marked[:] = 0
    for y in range(top, bottom):
        row = words[y, start : start + _WORDS]
        for k in range(_WORDS):
            marked[k] |= _above(row[k], ~high, add, either)
    threshold = int(test[2])
    for k in range(column * _WORDS - start, _WORDS):
        if marked[k] & high == 0:
            continue
        left = (start + k) * lanes
        right = min(left + lanes, image.shape[1])
        for y in range(top, bottom):
            if _above(words[y, start + k], ~high, add, either) & high == 0:
                continue
            for x in range(left, right):
                if image[y, x] >= threshold and _is_peak(image, y, x):
                    if n < found.shape[0]:
                        found[n, 0] = y
                        found[n, 1] = x
                    n += 1
    return n


@compiled
def _is_peak(image: Any, y: int, x: int) -> bool:
    """Whether no pixel of the 5x5 around is brighter, nor as bright and read earlier."""
    height, width = image.shape
    value = image[y, x]
    # The next pixels settle most cases, and cheaply.
    if (x + 1 < width and image[y, x + 1] > value) or (y + 1 < height and image[y + 1, x] > value):
        return False
    if (x > 0 and image[y, x - 1] >= value) or (y > 0 and image[y - 1, x] >= value):
        return False
    for j in range(max(y - 2, 0), min(y + 3, height)):
        for i in range(max(x - 2, 0), min(x + 3, width)):
            other = image[j, i]
            if other > value or (other == value and (j < y or (j == y and i < x))):
                return False
    return True
