"""One camera's sensor and lens: lights in pixels to an image.

Poisson noise adds up: that of the light of spots is drawn exactly, in the pixels where they shine,
and added to the ambient light's, see `noise.py`. Then it is rounded and saturates.
"""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fleet.simulation.scenario.physics import Optics
from fleet.simulation.world.grains import add, fall
from fleet.simulation.world.noise import noise, shifted
from tagmap.conventions import Array


@dataclass(frozen=True, slots=True)
class Lights:
    """Spots that move evenly from start to end (K, 2) px in the exposure, with their flux (K,) in
    grey levels altogether; discs (L, 4) of u, v, radius (px) and level."""

    start_px: Array
    end_px: Array
    flux: Array
    discs: Array


@dataclass(slots=True)
class Imager:
    """Keeps its working memory: one caller at a time."""

    width_px: int
    height_px: int
    optics: Optics
    seed: int
    _light: npt.NDArray[np.float32] = field(init=False)
    _touched: npt.NDArray[np.int32] = field(init=False)

    def __post_init__(self) -> None:
        self._light = np.zeros((self.height_px, self.width_px), dtype=np.float32)
        self._touched = np.empty(self._light.size, dtype=np.int32)

    def expose(
        self,
        lights: Lights,
        rng: np.random.Generator,
        onto: npt.NDArray[np.uint8] | None = None,
    ) -> npt.NDArray[np.uint8]:
        """An image (height, width): `onto`, or a new one."""
        optics = self.optics
        background = noise(
            self.seed,
            self.width_px,
            self.height_px,
            optics.ambient,
            optics.gain,
            optics.read_noise,
        )
        ground = shifted(background, rng)
        image = np.empty_like(ground.noise.rounded[0]) if onto is None else onto
        ground.onto(image)
        n = fall(
            self._light,
            lights.start_px,
            lights.end_px,
            lights.flux,
            lights.discs,
            optics.sigma_px,
            optics.halo,
            self._touched,
        )
        pixels = self._touched[:n]
        electrons = rng.poisson(self._light.reshape(-1)[pixels] / optics.gain)
        more = np.asarray(optics.gain * electrons, dtype=np.float64)
        add(image, self._light, pixels, more, *ground.counted)
        return image
