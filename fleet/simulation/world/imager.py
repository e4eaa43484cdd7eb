"""One camera's sensor and lens: lights in pixels to an image.

Poisson noise adds up: that of the light of spots is drawn exactly, in the pixels where they shine,
and added to the ambient light's, see `noise.py`. Then it is rounded and saturates.
"""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fleet.simulation.scenario.physics import Optics
from fleet.simulation.world.grains import LEAST, add, fall
from fleet.simulation.world.noise import noise, shifted
from tagmap.conventions import Array

HALO_WIDTH = 4.0
STEPS_PER_SIGMA = 2.0
STILL_PX = 0.02


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

    def expose(self, lights: Lights, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
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
        image = ground.image()
        n = fall(self._light, self._spots(lights), self._discs(lights), self._touched)
        pixels = self._touched[:n]
        electrons = rng.poisson(self._light.reshape(-1)[pixels] / optics.gain)
        more = np.asarray(optics.gain * electrons, dtype=np.float64)
        add(image, self._light, pixels, more, *ground.counted)
        return image

    def _spots(self, lights: Lights) -> Array:
        """Rows as `fall` wants them: streaks in steps, each with its halo, and small lamps."""
        sigma, halo = self.optics.sigma_px, self.optics.halo
        way = lights.end_px - lights.start_px
        length = np.hypot(way[:, 0], way[:, 1])
        steps = np.where(length < STILL_PX, 1, np.ceil(STEPS_PER_SIGMA * length / sigma) + 1)
        which = np.repeat(np.arange(len(steps)), steps.astype(np.int64))
        number = np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps.astype(np.int64))
        share = (number + 0.5) / steps[which]
        px = lights.start_px[which] + share[:, None] * way[which]
        flux, cut = lights.flux[which] / steps[which], LEAST / steps[which]
        core = np.column_stack([px, (1.0 - halo) * flux, np.full(len(px), sigma), cut])
        wide = np.column_stack([px, halo * flux, np.full(len(px), HALO_WIDTH * sigma), cut])
        u, v, radius, level = lights.discs[self._are_small(lights)].T
        # An even disc of radius r has the variance r^2 / 4 along each axis.
        lamps = [u, v, np.pi * radius**2 * level, np.hypot(sigma, 0.5 * radius)]
        return np.concatenate([core, wide, np.column_stack([*lamps, np.full(len(u), LEAST)])])

    def _discs(self, lights: Lights) -> Array:
        return np.ascontiguousarray(lights.discs[~self._are_small(lights)])

    def _are_small(self, lights: Lights) -> npt.NDArray[np.bool_]:
        small: npt.NDArray[np.bool_] = lights.discs[:, 2] < 2.0 * self.optics.sigma_px
        return small
