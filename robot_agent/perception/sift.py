"""Which bright pixels may be spots: compiled, a look at some pixels around each.

Thresholds are in sigmas of the noise. They let through every spot whose peak is 8 sigmas high
(one in a million is missed), and leave the last word to the fit.
"""

import math
from typing import Any

import numpy as np

from robot_agent.perception.compiled import compiled, inlined, internal
from robot_agent.perception.flags import Flag
from robot_agent.perception.scan import TILE_PX, TILE_ROWS
from tagmap.conventions import Array, Index

RING_PX = 5
"""Distance at which a spot's surroundings are sampled."""

_RING = np.array([[0, 5], [4, 4], [5, 0], [4, -4], [0, -5], [-4, -4], [-5, 0], [-4, 4]])
_CONTRAST = 4.0
_SUM_OF_9 = 4.0
_BROAD = 10.0
_HOT_SHARE = 0.12
"""Of a spot of sigma 0.5 px, the next pixels have 0.2 of the peak."""

_SATURATED, _HOT_PIXEL = int(Flag.SATURATED), int(Flag.HOT_PIXEL)
_OVERSIZED = int(Flag.OVERSIZED)
_NOISE = -1


@compiled
def noise(sensor: Any, level: float) -> float:
    """Variance of a pixel at `level`: light brings shot noise, see spots.Sensor."""
    more = sensor.gain * (level - sensor.reference)
    return float(max(sensor.variance + more, 0.25 * sensor.variance))


@internal
def starts_at(image: Any, background: Array, sensor: Any, peaks: Index) -> tuple[Array, Index]:
    """Of n peaks (row, column): starts (k, 4) as u, v, variance q, level; and flags (k,).

    Noise is left out, a lamp appears once.
    """
    n = peaks.shape[0]
    starts, flags = np.empty((n, 4)), np.empty(n, np.int64)
    visited, stack = np.zeros((0, 0), np.uint8), np.empty((0, 2), np.int32)
    ring = np.empty(8)
    kept = 0
    for k in range(n):
        y, x = peaks[k, 0], peaks[k, 1]
        dark = background[y // TILE_ROWS, x // TILE_PX]
        level = _surroundings(image, y, x, ring)
        sigma = math.sqrt(noise(sensor, level))
        contrast = image[y, x] - level > _CONTRAST * sigma
        bright = image[y, x] - dark > _BROAD * sigma
        if bright and (not contrast or _extends(image, y, x, dark, sensor.sigma_most)):
            if visited.size == 0:
                visited = np.zeros(image.shape, np.uint8)
                stack = np.empty((image.size, 2), np.int32)
            if visited[y, x]:
                continue
            half = 0.5 * (float(image[y, x]) + dark)
            area, u, v = _flood(image, y, x, half, visited, stack)
            if area > 8.0 * sensor.sigma_most**2:
                starts[kept, 0], starts[kept, 1], starts[kept, 2] = u, v, area / (2.0 * math.pi)
                starts[kept, 3], flags[kept] = dark, _OVERSIZED
                kept += 1
                continue
            for i in range(area):
                visited[stack[i, 0], stack[i, 1]] = 0
        if contrast:
            flags[kept] = _start(image, y, x, level, sigma, sensor, starts[kept])
            if flags[kept] != _NOISE:
                kept += 1
    return starts[:kept], flags[:kept]


@inlined
def _surroundings(image: Any, y: int, x: int, ring: Array) -> float:
    """Median of eight pixels around, so that a neighbouring spot does not matter."""
    height, width = image.shape
    for i in range(8):
        value = float(
            image[min(max(y + _RING[i, 0], 0), height - 1), min(max(x + _RING[i, 1], 0), width - 1)]
        )
        j = i
        while j > 0 and ring[j - 1] > value:
            ring[j] = ring[j - 1]
            j -= 1
        ring[j] = value
    return float(0.5 * (ring[3] + ring[4]))


@compiled
def _extends(image: Any, y: int, x: int, dark: float, sigma_most: float) -> bool:
    """Whether somewhere at three times the largest sigma it is still half as bright."""
    height, width = image.shape
    half = 0.5 * (float(image[y, x]) + dark)
    scale = 3.0 * sigma_most / RING_PX
    for i in range(8):
        j = y + int(scale * _RING[i, 0])
        k = x + int(scale * _RING[i, 1])
        if 0 <= j < height and 0 <= k < width and image[j, k] > half:
            return True
    return False


@compiled
def _flood(
    image: Any, y: int, x: int, level: float, visited: Any, stack: Any
) -> tuple[int, float, float]:
    """Area and centroid of the connected region above `level`; `stack` then lists its pixels."""
    height, width = image.shape
    stack[0, 0], stack[0, 1] = y, x
    visited[y, x] = 1
    done, n = 0, 1
    u, v = 0.0, 0.0
    while done < n:
        row, column = stack[done, 0], stack[done, 1]
        done += 1
        u += column
        v += row
        for d in range(4):
            j = row + (d == 0) - (d == 1)
            i = column + (d == 2) - (d == 3)
            if 0 <= j < height and 0 <= i < width and not visited[j, i] and image[j, i] > level:
                visited[j, i] = 1
                stack[n, 0], stack[n, 1] = j, i
                n += 1
    return n, u / n, v / n


@inlined
def _start(
    image: Any, y: int, x: int, level: float, sigma: float, sensor: Any, start: Array
) -> int:
    """Fill in u, v, q, level; the flags of the peak, or -1 where it is noise after all."""
    height, width = image.shape
    start[0], start[1], start[2], start[3] = x, y, 1.5, level
    if image[y, x] >= sensor.full_scale:
        _middle_of_saturation(image, y, x, sensor.full_scale, start)
        return _SATURATED
    if not (0 < y < height - 1 and 0 < x < width - 1):
        return 0
    c0, c1, c2 = 0.0, 0.0, 0.0
    r0, r2 = 0.0, 0.0
    for i in range(-1, 2):
        c0 += image[y + i, x - 1] - level
        c1 += image[y + i, x] - level
        c2 += image[y + i, x + 1] - level
        r0 += image[y - 1, x + i] - level
        r2 += image[y + 1, x + i] - level
    total = c0 + c1 + c2
    r1 = total - r0 - r2
    if total < _SUM_OF_9 * 5.0 * sigma:
        return _NOISE
    peak = image[y, x] - level
    cross = (c1 - peak) + (r1 - peak)
    if cross < 4.0 * _HOT_SHARE * peak:
        start[3] = level
        return _HOT_PIXEL
    start[0] = x + _vertex(c0, c1, c2)
    start[1] = y + _vertex(r0, r1, r2)
    falloff = 0.25 * ((c0 + c2) / max(c1, 1e-9) + (r0 + r2) / max(r1, 1e-9))
    # exp(-1 / (2 q)) to the next column; a broad or noisy one starts at a sigma of 2 px.
    start[2] = -0.5 / math.log(min(max(falloff, 0.2), 0.88))
    return 0


@compiled
def _vertex(before: float, at: float, after: float) -> float:
    bend = 2.0 * at - before - after
    return min(max(0.5 * (after - before) / bend, -0.6), 0.6) if bend > 0.0 else 0.0


@compiled
def _middle_of_saturation(image: Any, y: int, x: int, full_scale: float, start: Array) -> None:
    height, width = image.shape
    u, v, n = 0.0, 0.0, 0
    for j in range(y, min(y + 12, height)):
        for i in range(max(x - 8, 0), min(x + 9, width)):
            # The peak is the first of its plateau in reading order.
            if image[j, i] >= full_scale:
                u += i
                v += j
                n += 1
    start[0], start[1] = u / n, v / n
    start[2] = max(n / math.pi / 2.0, 1.5)
