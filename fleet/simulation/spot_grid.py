"""Images with a grid of isolated spots at random places within their cells."""

from typing import Any

import numpy as np
import numpy.typing as npt

from fleet.simulation.image import Sensor, add_spots, dark, expose, flux_of_peak
from tagmap.conventions import Array, Index

AMBIENT = 20.0
SIGMA_PX = 1.2
SENSOR = Sensor()


def spot_grid(
    rng: np.random.Generator,
    peak: float,
    sensor: Sensor = SENSOR,
    columns: int = 12,
    rows: int = 9,
    sigma_px: float = SIGMA_PX,
    ambient: float = AMBIENT,
) -> tuple[npt.NDArray[Any], Array]:
    """An image and the true px (columns * rows, 2)."""
    cell = np.array([sensor.width_px / columns, sensor.height_px / rows])
    index = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    px = (index + 0.5) * cell + rng.uniform(-4.0, 4.0, (columns * rows, 2))
    light = dark(sensor, ambient)
    add_spots(light, px, flux_of_peak(peak, sigma_px), sigma_px)
    return expose(light, sensor, rng), px


def nearest(found_px: Array, true_px: Array) -> tuple[Index, Array]:
    """For each true spot the index of the nearest found one and its distance."""
    distance = np.linalg.norm(true_px[:, None] - found_px[None], axis=-1)
    return distance.argmin(1), distance.min(1)
