"""Streams of random numbers, one for each purpose, in no order that matters."""

import numpy as np

from fleet.simulation.scene import chance


def stream(seed: int, *what: str | int) -> np.random.Generator:
    """The same for the same words."""
    return np.random.default_rng(chance.bits(seed, *what))
