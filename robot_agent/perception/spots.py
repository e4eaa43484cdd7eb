"""Bright spots of one image, with what is known of each."""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from robot_agent.perception import crowds, measure
from robot_agent.perception.flags import REFUSED
from tagmap.conventions import Array, Index, Mask

Image: TypeAlias = npt.NDArray[Any]
"""(height, width) of uint8 or uint16."""

MOST = 1024
LEAST_SIDE_PX = 16

WITH_LEVEL = 1.4
"""By which the sigma of a flux is larger because the background is measured in the same window,
where that is what noise there is; where shot noise is more, up to 1.0."""


@dataclass(frozen=True, slots=True)
class Optics:
    """What spots look like, and what the sensor adds.

    sigma_px         least and largest sigma of a tag's spot; a lamp is larger
    gain             grey levels per electron: shot noise. 0: not known, all noise is as that of
                     the background
    full_scale       grey level at which the sensor saturates; None: the largest of the type
    threshold        sigmas of the noise by which a spot's peak at least exceeds the background
    """

    sigma_px: tuple[float, float] = (0.5, 4.0)
    gain: float = 0.0
    full_scale: int | None = None
    threshold: float = 4.5


@dataclass(frozen=True, slots=True)
class Spots:
    """Spots and refused objects of an image, roughly from its top to its bottom.

    rows (N, 9)  see measure.COLUMNS
    flags (N,)   see Flag
    noise        sigma of the background in grey levels
    truncated    there were more than MOST bright objects; only those are here
    """

    rows: Array
    flags: Index
    noise: float
    truncated: bool

    def __len__(self) -> int:
        return len(self.flags)

    @property
    def px(self) -> Array:
        """(N, 2) as (u, v); (0, 0) is the centre of the top-left pixel."""
        return self.rows[:, 0:2]

    @property
    def cov_px2(self) -> Array:
        """(N, 2, 2) of px; NaN where the position is not known."""
        return self.rows[:, 2:6].reshape(-1, 2, 2)

    @property
    def flux(self) -> Array:
        """(N,) grey levels summed over the spot, without its background."""
        return self.rows[:, 6]

    @property
    def sigma_flux(self) -> Array:
        """(N,) of flux, NaN where the position is not known.

        For a Gaussian of free width the error of its light is to its light as the error of its
        position is to its width, whatever the noise; the level of the background adds to it.
        """
        variance = 0.5 * (self.rows[:, 2] + self.rows[:, 5])
        return self.flux * WITH_LEVEL * np.sqrt(variance / self.rows[:, 7])

    @property
    def sigma_px(self) -> Array:
        """(N,) of the Gaussian that the optics make of a tag, without the pixels' own width."""
        return np.sqrt(np.maximum(self.rows[:, 7] - measure.PIXEL_VARIANCE, 0.0))

    @property
    def usable(self) -> Mask:
        """(N,) whether it may be a tag, and where it is is known."""
        usable: Mask = ((self.flags & int(REFUSED)) == 0) & np.isfinite(self.rows[:, 2])
        return usable


def detect(image: Image, optics: Optics = Optics()) -> Spots:
    """Spots of an image (height, width) of 8 or 16 bits.

    Raises ValueError for any other, and for a full scale that its type cannot hold.
    """
    _check(image)
    full_scale = float(full_scale_of(image, optics))
    if not (image.flags.c_contiguous and image.dtype.isnative):
        image = np.ascontiguousarray(image, image.dtype.newbyteorder("="))
    # Whether it may be written to is part of its type: all alike, so that one is compiled.
    image = image.view()
    image.flags.writeable = False
    rows, flags, variance, background, n, merged = measure.spots(
        image, optics.threshold, optics.gain, full_scale, *optics.sigma_px, MOST
    )
    if merged:
        sensor = measure.Sensor(variance, background, optics.gain, full_scale, *optics.sigma_px)
        rows, flags = crowds.place(image, sensor, rows, flags)
    return Spots(rows, flags, variance**0.5, n > MOST)


def full_scale_of(image: Image, optics: Optics) -> int:
    """Grey level at which `image` saturates. Raises ValueError where its type cannot hold it."""
    bits = 8 * image.itemsize
    largest = (1 << bits) - 1
    level = largest if optics.full_scale is None else optics.full_scale
    if not 1 <= level <= largest:
        raise ValueError(
            f"full scale is {level}, expected 1 to {largest}: the image has {bits} bits"
        )
    return level


def _check(image: Image) -> None:
    if image.dtype.kind != "u" or image.dtype.itemsize > 2 or image.ndim != 2:
        shape = "x".join(map(str, image.shape))
        raise ValueError(f"image is {shape} {image.dtype}, expected grey levels of 8 or 16 bits")
    if min(image.shape) < LEAST_SIDE_PX:
        height, width = image.shape
        raise ValueError(f"image is {width}x{height} px, expected at least {LEAST_SIDE_PX} a side")
