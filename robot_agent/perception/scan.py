"""Where an image may hold a spot: compiled, one pass over all pixels.

An image without anything bright costs little more than reading it: of each row only the brightest
pixel is asked for, which takes one instruction for as many pixels as the processor can hold, and
only a block that holds something above its threshold is looked at closer.
"""

from typing import Any

import numpy as np

from robot_agent.perception.compiled import compiled, inlined, internal
from tagmap.conventions import Array, Index

TILE_PX = 256
TILE_ROWS = 128

_BAND_ROWS = 8
"""Of a block: a bit each in a byte. Divides TILE_ROWS."""

_PLACES = 5
_RUN_PX = 16
_LEAST_VARIANCE = 1.0 / 12.0
_OUTLIER = 3.0
"""A variance of 15 degrees of freedom is as many times its mean once in ten thousand."""


@internal
def survey(image: Any) -> tuple[Array, float]:
    """Background (tile rows, tile columns) and the variance of its noise, in grey levels.

    A tile's background is the median of five runs of sixteen pixels, so neither spots nor a lamp
    that covers two of them move it. Noise is the scatter within runs, those with an edge left out.
    """
    height, width = image.shape
    rows, columns = -(-height // TILE_ROWS), -(-width // TILE_PX)
    background = np.empty((rows, columns))
    scatter = np.empty(rows * columns * _PLACES)
    means = np.empty(_PLACES)
    calm = 0.0
    n = 0
    for row in range(rows):
        top = row * TILE_ROWS
        step_y = min(TILE_ROWS, height - top) // 8
        for column in range(columns):
            left = column * TILE_PX
            step_x = max(min(TILE_PX, width - left) - _RUN_PX, 0) // 4
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
def peaks(image: Any, background: Array, excess: float, found: Index) -> int:
    """Rows and columns of 5x5 maxima that exceed their background by `excess`, into found (n, 2).

    Returns how many there are, which may be more than `found` holds.
    """
    thresholds = _thresholds(image, background, excess)
    bright = np.empty((TILE_ROWS // _BAND_ROWS, background.shape[1]), np.uint8)
    eights = np.empty(TILE_PX // 8, np.uint64)
    crests = eights.view(np.uint8)
    n = int(np.int64(0))
    # One row of tiles at a time is still in the fast caches when its blocks are looked at.
    for tile_row in range(background.shape[0]):
        threshold, top = thresholds[tile_row], tile_row * TILE_ROWS
        _mark_blocks(image, top, threshold, bright)
        for band in range(bright.shape[0]):
            for column in range(bright.shape[1]):
                rows = bright[band, column]
                if rows:
                    y, x, least = top + band * _BAND_ROWS, column * TILE_PX, threshold[column]
                    n = _peaks_of_block(image, y, x, rows, least, eights, crests, found, n)
    return n


@compiled
def _thresholds(image: Any, background: Array, excess: float) -> Any:
    """Least bright grey level of each tile, in the type of the image."""
    thresholds = np.empty(background.shape, image.dtype)
    full_scale = (1 << 8 * image.itemsize) - 1
    for row in range(background.shape[0]):
        for column in range(background.shape[1]):
            # Full scale itself is always bright enough.
            thresholds[row, column] = min(int(background[row, column] + excess) + 1, full_scale)
    return thresholds


@compiled
def _mark_blocks(image: Any, top: int, threshold: Any, bright: Any) -> None:
    """Bits of the rows in which a block (bands, columns) of a tile row reaches its threshold."""
    height, width = image.shape
    bright[:] = 0
    least = threshold.min()
    for y in range(top, min(top + TILE_ROWS, height)):
        row = image[y]
        if _brightest(row) < least:
            continue
        for column in range(len(threshold)):
            left = column * TILE_PX
            if _brightest(row[left : min(left + TILE_PX, width)]) >= threshold[column]:
                bright[(y - top) // _BAND_ROWS, column] |= 1 << y % _BAND_ROWS


@inlined
def _brightest(pixels: Any) -> Any:
    most = pixels[0]
    for x in range(len(pixels)):
        most = max(most, pixels[x])
    return most


@compiled
def _peaks_of_block(
    image: Any,
    top: int,
    left: int,
    rows: Any,
    threshold: Any,
    eights: Any,
    crests: Any,
    found: Index,
    n: int,
) -> int:
    """Add the peaks in those rows of a block whose bits are set to the n that there are.

    crests: room for a byte per column, whose bits say in which rows it is no darker than above and
    below. eights: the same memory, eight at a time.
    """
    height, width = image.shape
    right = min(left + TILE_PX, width)
    eights[:] = 0
    for k in range(_BAND_ROWS):
        if not rows >> k & 1:
            continue
        y = top + k
        row, above = image[y, left:right], image[max(y - 1, 0), left:right]
        below = image[min(y + 1, height - 1), left:right]
        bit = np.uint8(1 << k)
        for x in range(len(row)):
            crest = (row[x] >= threshold) & (row[x] >= above[x]) & (row[x] >= below[x])
            crests[x] |= bit if crest else np.uint8(0)
    for i in range(len(eights)):
        if eights[i] == 0:
            continue
        for x in range(8 * i, 8 * i + 8):
            left_over, y = crests[x], top
            while left_over:
                if left_over & 1 and _is_peak(image, y, left + x):
                    if n < found.shape[0]:
                        found[n, 0], found[n, 1] = y, left + x
                    n += 1
                left_over >>= 1
                y += 1
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
