"""The pass over the image beside one that is easy to read."""

import numpy as np
import pytest

from robot_agent.perception.scan import TILE_PX, TILE_ROWS, peaks


def peaks_one_by_one(image, background, excess: float) -> set[tuple[int, int]]:
    """Brighter than all of the 5x5 around that is read earlier, no darker than the rest."""
    height, width = image.shape
    padded = np.full((height + 4, width + 4), -1)
    padded[2:-2, 2:-2] = image
    least = np.minimum((background + excess).astype(int) + 1, np.iinfo(image.dtype).max)
    tiled = np.repeat(np.repeat(least, TILE_ROWS, axis=0), TILE_PX, axis=1)[:height, :width]
    best = image >= tiled
    for k in range(25):
        j, i = divmod(k, 5)
        other = padded[j : j + height, i : i + width]
        best &= image > other if k < 12 else image >= other
    return set(zip(*(axis.tolist() for axis in np.nonzero(best)), strict=True))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(16, 16), (131, 300), (257, 512), (129, 1), (1, 40)])
def test_every_peak_above_its_tile_is_found(dtype: type, shape: tuple[int, int]):
    """Few grey levels, so that ties and plateaus abound; saturated ones among them."""
    rng = np.random.default_rng(sum(shape))
    image = rng.integers(0, 12, shape).astype(dtype)
    image[rng.random(shape) < 0.02] = np.iinfo(dtype).max
    tiles = -(-shape[0] // TILE_ROWS), -(-shape[1] // TILE_PX)
    background = rng.uniform(2.0, 8.0, tiles)
    background[-1, -1] = float(np.iinfo(dtype).max)
    found = np.empty((image.size, 2), np.int64)
    n = peaks(image, background, 2.5, found)
    assert {(int(y), int(x)) for y, x in found[:n]} == peaks_one_by_one(image, background, 2.5)
    assert len({tuple(row) for row in found[:n].tolist()}) == n
