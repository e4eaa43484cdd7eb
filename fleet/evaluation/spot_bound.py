"""How well the position of a spot can be known at all: the Cramér-Rao bound."""

import numpy as np

from fleet.simulation.image import Sensor
from tagmap.conventions import Array

_HALF_PX = 15


def position_bound(
    px: Array, flux: float, sigma_px: float, sensor: Sensor, ambient: float
) -> Array:
    """Least covariance (N, 2, 2) in px^2 of unbiased estimates of isolated spots at px (N, 2).

    Everything else about the spot is taken as known. Noise is the sensor's, its rounding to whole
    grey levels included; with a gain, that of the light as well.
    """
    i = np.arange(-_HALF_PX, _HALF_PX + 1)
    offset = px - np.rint(px)
    share, slope = _pixel_shares(i - offset[..., None], sigma_px)
    light = flux * share[:, 1, :, None] * share[:, 0, None, :]
    J = flux * np.stack(
        [
            share[:, 1, :, None] * slope[:, 0, None, :],
            slope[:, 1, :, None] * share[:, 0, None, :],
        ],
        axis=-1,
    )
    variance = sensor.read_noise**2 + 1.0 / 12.0 + sensor.gain * (ambient + light)
    information = np.einsum("njia,njib,nji->nab", J, J, 1.0 / variance)
    bound: Array = np.linalg.inv(information)
    return bound


def _pixel_shares(d: Array, sigma: float) -> tuple[Array, Array]:
    """What of a Gaussian lies in pixels at distances d of its centre; derivative by the centre."""
    from scipy.special import ndtr

    a, b = (d - 0.5) / sigma, (d + 0.5) / sigma
    density = [np.exp(-0.5 * x * x) / (sigma * np.sqrt(2.0 * np.pi)) for x in (a, b)]
    return ndtr(b) - ndtr(a), density[0] - density[1]
