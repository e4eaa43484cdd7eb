"""A floor that is not quite flat, and where a robot stands on it."""

import math
from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array

WAVES = 8
LENGTH_M = (2.5, 9.0)
"""Of the waves, shortest and longest: slabs and screeds, not cobbles."""


@dataclass(frozen=True, slots=True)
class Floor:
    """height(x, y) = sum of amplitude * sin(wave . (x, y) + phase), waves (N, 2) in rad/m."""

    amplitude_m: Array
    wave: Array
    phase_rad: Array

    def stand(self, x: float, y: float, theta: float) -> Array:
        """T_map_base (4, 4): z of base is the floor's normal, x is ahead."""
        angle = self.wave @ np.array([x, y]) + self.phase_rad
        slope_x, slope_y = ((self.amplitude_m * np.cos(angle)) @ self.wave).tolist()
        z = float(self.amplitude_m @ np.sin(angle))
        length = math.sqrt(1.0 + slope_x**2 + slope_y**2)
        up = (-slope_x / length, -slope_y / length, 1.0 / length)
        c, s = math.cos(theta), math.sin(theta)
        rise = c * slope_x + s * slope_y
        run = math.sqrt(1.0 + rise * rise)
        ahead = (c / run, s / run, rise / run)
        left = (
            up[1] * ahead[2] - up[2] * ahead[1],
            up[2] * ahead[0] - up[0] * ahead[2],
            up[0] * ahead[1] - up[1] * ahead[0],
        )
        columns = (ahead, left, up, (x, y, z))
        return np.array([[column[i] for column in columns] for i in range(3)] + [[0, 0, 0, 1.0]])


def uneven(rng: np.random.Generator, sigma_m: float) -> Floor:
    """Whose height has this standard deviation over a large area."""
    direction = rng.uniform(0.0, 2.0 * np.pi, WAVES)
    length = rng.uniform(*LENGTH_M, WAVES)
    wave = (2.0 * np.pi / length)[:, None] * np.stack([np.cos(direction), np.sin(direction)], -1)
    amplitude = np.full(WAVES, sigma_m * math.sqrt(2.0 / WAVES))
    return Floor(amplitude, wave, rng.uniform(0.0, 2.0 * np.pi, WAVES))
