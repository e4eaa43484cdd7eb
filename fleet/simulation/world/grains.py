"""Light falls on pixels: spots and discs added up where they are, and nowhere else."""

import math

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled, inlined

LEAST = 0.02
"""Grey levels below which the tail of a spot is cut off: a hundredth of the noise."""
FARTHEST = 6.0
FULL_SCALE = 255


@inlined
def _add(
    flat: npt.NDArray[np.float32],
    at: int,
    more: float,
    touched: npt.NDArray[np.int32],
    n: int,
) -> int:
    if more > 1e-6:
        if flat[at] == 0.0:
            touched[n] = at
            n += 1
        flat[at] += more
    return n


@compiled
def fall(
    light: npt.NDArray[np.float32],
    spots: Array,
    discs: Array,
    touched: npt.NDArray[np.int32],
) -> int:
    """Adds spots (K, 5) of u, v, flux, sigma (px) and the level at which to cut off, Gaussians
    integrated over each pixel; then discs (L, 4) of u, v, radius, level with an edge of one pixel.

    `light` (height, width) is 0 before; the n pixels that got any are put into `touched`.
    """
    height, width = light.shape
    flat = light.reshape(-1)
    n = 0
    across = np.empty(width)
    for k in range(len(spots)):
        u, v, flux, sigma, cut = spots[k]
        peak = flux / (2.0 * math.pi * sigma * sigma)
        if not peak > cut:
            continue
        reach = sigma * min(FARTHEST, math.sqrt(2.0 * math.log(peak / cut))) + 1.0
        u0, u1 = max(0, math.ceil(u - reach)), min(width - 1, math.floor(u + reach))
        v0, v1 = max(0, math.ceil(v - reach)), min(height - 1, math.floor(v + reach))
        scale = 1.0 / (sigma * math.sqrt(2.0))
        before = math.erf((u0 - 0.5 - u) * scale)
        for i in range(u0, u1 + 1):
            behind = math.erf((i + 0.5 - u) * scale)
            across[i], before = behind - before, behind
        before = math.erf((v0 - 0.5 - v) * scale)
        for j in range(v0, v1 + 1):
            behind = math.erf((j + 0.5 - v) * scale)
            row, before = 0.25 * flux * (behind - before), behind
            for i in range(u0, u1 + 1):
                n = _add(flat, j * width + i, row * across[i], touched, n)
    for k in range(len(discs)):
        u, v, radius, level = discs[k]
        reach = radius + 0.5
        u0, u1 = max(0, math.ceil(u - reach)), min(width - 1, math.floor(u + reach))
        v0, v1 = max(0, math.ceil(v - reach)), min(height - 1, math.floor(v + reach))
        for j in range(v0, v1 + 1):
            for i in range(u0, u1 + 1):
                share = reach - math.sqrt((i - u) ** 2 + (j - v) ** 2)
                n = _add(flat, j * width + i, level * min(1.0, share), touched, n)
    return n


@compiled
def add(
    image: npt.NDArray[np.uint8],
    light: npt.NDArray[np.float32],
    pixels: npt.NDArray[np.int32],
    more: Array,
    counted: npt.NDArray[np.float32],
    down: int,
    right: int,
) -> None:
    """Counts `more` (n,) grey levels in these pixels, on top of what was `counted` (height, width),
    whose pixel (down, right) is at the origin; `light` is 0 there afterwards."""
    height, width = image.shape
    for k in range(len(pixels)):
        row, column = pixels[k] // width, pixels[k] % width
        level = more[k] + counted[(row + down) % height, (column + right) % width]
        image[row, column] = min(max(np.rint(level), 0.0), FULL_SCALE)
        light[row, column] = 0.0
