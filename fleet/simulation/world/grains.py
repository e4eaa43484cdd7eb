"""Light falls on pixels: spots and discs added up where they are, and nowhere else."""

import math

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled, inlined

LEAST = 0.02
"""Grey levels below which the tail of a spot is cut off: a hundredth of the noise."""
FARTHEST = 6.0
HALO_WIDTH = 4.0
STEPS_PER_SIGMA = 2.0
"""Of a streak."""
STILL_PX = 0.02
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
    start: Array,
    end: Array,
    flux: Array,
    discs: Array,
    sigma: float,
    halo: float,
    touched: npt.NDArray[np.int32],
) -> int:
    """Adds spots that move from start to end (K, 2) with flux (K,), all of `sigma` (px), a share
    `halo` of their light around them; then discs (L, 4) of u, v, radius, level.

    `light` (height, width) is 0 before; the n pixels that got any are put into `touched`.
    """
    n = int(np.int64(0))
    across = np.empty(light.shape[1])
    for share, width in ((1.0 - halo, sigma), (halo, HALO_WIDTH * sigma)):
        for k in range(len(flux)):
            du, dv = end[k, 0] - start[k, 0], end[k, 1] - start[k, 1]
            length = math.sqrt(du * du + dv * dv)
            steps = 1 if length < STILL_PX else math.ceil(STEPS_PER_SIGMA * length / sigma) + 1
            for step in range(steps):
                s = (step + 0.5) / steps
                u, v = start[k, 0] + s * du, start[k, 1] + s * dv
                one = share * (flux[k] / steps)
                n = _spot(light, u, v, one, width, LEAST / steps, across, touched, n)
    for k in range(len(discs)):
        u, v, radius, level = discs[k]
        if radius < 2.0 * sigma:
            # An even disc of radius r has the variance r^2 / 4 along each axis.
            wide = math.sqrt(sigma * sigma + 0.25 * radius * radius)
            one = math.pi * radius * radius * level
            n = _spot(light, u, v, one, wide, LEAST, across, touched, n)
        else:
            n = _disc(light, u, v, radius, level, touched, n)
    return n


@compiled
def _spot(
    light: npt.NDArray[np.float32],
    u: float,
    v: float,
    flux: float,
    sigma: float,
    cut: float,
    across: Array,
    touched: npt.NDArray[np.int32],
    n: int,
) -> int:
    """A Gaussian integrated over each pixel, down to the level `cut`."""
    height, width = light.shape
    peak = flux / (2.0 * math.pi * sigma * sigma)
    if not peak > cut:
        return n
    flat = light.reshape(-1)
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
    return n


@compiled
def _disc(
    light: npt.NDArray[np.float32],
    u: float,
    v: float,
    radius: float,
    level: float,
    touched: npt.NDArray[np.int32],
    n: int,
) -> int:
    """With an edge of one pixel."""
    height, width = light.shape
    flat = light.reshape(-1)
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
