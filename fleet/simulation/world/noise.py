"""What a camera counts where no tag shines: frames of noise, made once and shifted at random.

A frame is ambient light with its shot noise and the read noise, exact for every pixel. Images take
one of FRAMES frames, shifted around by a random number of rows and columns. So the noise of any one
pixel is independent between images but for one chance in FRAMES * height * width, while an image as
a whole is not: shifted back, two of the same frame are alike. Nothing that looks at spots can tell.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from fleet.simulation.world.chances import stream
from fleet.simulation.world.grains import FULL_SCALE

FRAMES = 4


@dataclass(frozen=True, slots=True)
class Noise:
    """counted (FRAMES, height, width) before rounding, rounded likewise."""

    counted: npt.NDArray[np.float32]
    rounded: npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Shifted:
    """Frame `frame` with its pixel (down, right) at the origin."""

    noise: Noise
    frame: int
    down: int
    right: int

    def onto(self, made: npt.NDArray[np.uint8]) -> None:
        """An image (height, width)."""
        frame, d, r = self.noise.rounded[self.frame], self.down, self.right
        h, w = frame.shape
        made[: h - d, : w - r], made[: h - d, w - r :] = frame[d:, r:], frame[d:, :r]
        made[h - d :, : w - r], made[h - d :, w - r :] = frame[:d, r:], frame[:d, :r]

    @property
    def counted(self) -> tuple[npt.NDArray[np.float32], int, int]:
        """What was counted before rounding (height, width), and which of its pixels is at the
        origin."""
        return self.noise.counted[self.frame], self.down, self.right


@lru_cache(maxsize=4)
def noise(
    seed: int, width: int, height: int, ambient: float, gain: float, read_noise: float
) -> Noise:
    """Frames of a sensor under even light of `ambient` grey levels."""
    rng = stream(seed, "noise")
    counted = np.empty((FRAMES, height, width), dtype=np.float32)
    for frame in counted:
        frame[:] = gain * rng.poisson(ambient / gain, frame.shape)
        frame += read_noise * rng.standard_normal(frame.shape, dtype=np.float32)
    rounded = np.clip(np.rint(counted), 0, FULL_SCALE).astype(np.uint8)
    return Noise(counted, rounded)


def shifted(noise: Noise, rng: np.random.Generator) -> Shifted:
    frames, height, width = noise.rounded.shape
    return Shifted(
        noise, int(rng.integers(frames)), int(rng.integers(height)), int(rng.integers(width))
    )
