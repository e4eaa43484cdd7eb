"""What turns the mirrors: angles to volts to steps of the digital-analogue converter."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index


@dataclass(frozen=True, slots=True)
class Drive:
    """Of mirrors X, Y in this order.

    limits_rad  (2, 2) least and most angle of each mirror
    v_per_rad   (2,) and v_at_zero (2,): volts = v_at_zero + v_per_rad * angle
    limits_v    (2,) least and most volts that either may get
    dac_v       (2,) span of the converter; step 0 gives the least, one past the last the most
    dac_bits    of the converter
    """

    limits_rad: Array
    v_per_rad: Array
    v_at_zero: Array
    limits_v: Array
    dac_v: Array
    dac_bits: int

    @property
    def v_per_step(self) -> float:
        low, high = self.dac_v.tolist()
        span: float = high - low
        return span / (1 << self.dac_bits)


def volts(drive: Drive, theta: Array) -> Array:
    """(..., 2) in V of mirror angles theta (..., 2)."""
    return drive.v_at_zero + drive.v_per_rad * theta


def nearest_steps(drive: Drive, theta: Array) -> Index:
    """(..., 2) of the converter, those nearest to theta (..., 2) that it has; theta is finite."""
    steps = np.rint((volts(drive, theta) - drive.dac_v[0]) / drive.v_per_step)
    held: Index = np.clip(steps, 0, (1 << drive.dac_bits) - 1).astype(np.int64)
    return held


def angles_of(drive: Drive, steps: Index) -> Array:
    """theta (..., 2) in rad at steps (..., 2)."""
    theta: Array = (drive.dac_v[0] + steps * drive.v_per_step - drive.v_at_zero) / drive.v_per_rad
    return theta
