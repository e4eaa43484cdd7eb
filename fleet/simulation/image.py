"""Images of lit tags, and of what else shines: light first, then the sensor that counts it.

Everything that adds light works in place on `light` (height, width), expected grey levels; `expose`
turns it into an image with shot noise, read noise, rounding and saturation. Light beyond the edge
is cut off. Pixel (0, 0) is the centre of the top-left pixel.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array

_REACH = 6.0
"""Sigmas beyond which a spot has less than 1e-8 of its light."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """What turns light into numbers.

    read_noise  sigma in grey levels
    gain        grey levels per electron; 0: no shot noise
    bits        8 or 16: the type of the image
    full_scale  where it saturates; None: the largest number of `bits`
    """

    width_px: int = 640
    height_px: int = 480
    read_noise: float = 2.0
    gain: float = 0.0
    bits: int = 8
    full_scale: int | None = None


def dark(sensor: Sensor, level: float = 20.0, slope: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Ambient light: `level` at the centre, changing by `slope` grey levels per px in u and v."""
    v, u = np.indices((sensor.height_px, sensor.width_px), dtype=np.float64)
    ramp = slope[0] * (u - 0.5 * (sensor.width_px - 1)) + slope[1] * (
        v - 0.5 * (sensor.height_px - 1)
    )
    return np.maximum(level + ramp, 0.0)


def add_spots(light: Array, px: Array, flux: Array | float, sigma_px: Array | float = 1.2) -> None:
    """Gaussians integrated over each pixel, at px (N, 2); flux (N,) in grey levels altogether."""
    each = (np.broadcast_to(value, len(px)) for value in (flux, sigma_px))
    for (u, v), one_flux, sigma in zip(px, *each, strict=True):
        x, y = (_near(centre, sigma, n) for centre, n in ((u, light.shape[1]), (v, light.shape[0])))
        light[y[0] : y[-1], x[0] : x[-1]] += one_flux * np.outer(
            _shares(y, v, sigma), _shares(x, u, sigma)
        )


def flux_of_peak(peak: float, sigma_px: float) -> float:
    """Flux of the spot whose light is `peak` grey levels high at its very centre."""
    return 2.0 * np.pi * sigma_px**2 * peak


def add_streak(
    light: Array, start_px: Array, end_px: Array, flux: float, sigma_px: float = 1.2
) -> None:
    """A spot that moves evenly from start to end (2,) during the exposure."""
    n = max(2, int(4.0 * np.linalg.norm(end_px - start_px) / sigma_px))
    share = ((np.arange(n) + 0.5) / n)[:, None]
    add_spots(light, start_px + share * (end_px - start_px), flux / n, sigma_px)


def add_lamp(light: Array, centre_px: Array, radius_px: float, level: float) -> None:
    """A disc of even brightness with an edge one pixel soft."""
    v, u = np.indices(light.shape, dtype=np.float64)
    distance = np.hypot(u - centre_px[0], v - centre_px[1])
    light += level * np.clip(radius_px + 0.5 - distance, 0.0, 1.0)


def add_hot_pixels(light: Array, at: npt.NDArray[np.int64], level: float) -> None:
    """`level` more in each of the pixels at (N, 2) as (column, row)."""
    light[at[:, 1], at[:, 0]] += level


def expose(light: Array, sensor: Sensor, rng: np.random.Generator) -> npt.NDArray[Any]:
    """An image of `light` (height, width): uint8 or uint16."""
    if sensor.gain > 0.0:
        light = sensor.gain * rng.poisson(light / sensor.gain).astype(np.float64)
    counted = light + sensor.read_noise * rng.standard_normal(light.shape)
    full_scale = sensor.full_scale or (1 << sensor.bits) - 1
    dtype = np.uint8 if sensor.bits == 8 else np.uint16
    return np.clip(np.rint(counted), 0.0, full_scale).astype(dtype)


def _near(centre: float, sigma: float, n: int) -> npt.NDArray[np.int64]:
    """Indices i of the pixel borders i - 0.5 around `centre` that lie in the image."""
    first = np.clip(np.floor(centre - _REACH * sigma - 0.5), 0, n)
    last = np.clip(np.ceil(centre + _REACH * sigma + 1.5), 0, n)
    return np.arange(int(first), int(last) + 1)


def _shares(borders: npt.NDArray[np.int64], centre: float, sigma: float) -> Array:
    """What of a Gaussian's light falls between consecutive borders."""
    from scipy.special import ndtr

    shares: Array = np.diff(ndtr((borders - 0.5 - centre) / sigma))
    return shares
