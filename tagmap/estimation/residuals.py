"""How far each factor is from being met, and how much each is believed."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.problem import Problem


@dataclass(frozen=True, slots=True)
class Residuals:
    """Squared whitened residuals per factor: one (K,) per block of sightings, then the others.

    That of a sighting that cannot be (a tag behind the camera) is inf.
    """

    sightings: tuple[Array, ...]
    odometry: Array
    surveyed: Array
    calibration: Array


@dataclass(frozen=True, slots=True)
class Weights:
    """Robust weight of each factor, 0..1, in the order of Residuals."""

    sightings: tuple[Array, ...]
    odometry: Array
    surveyed: Array

    @classmethod
    def ones(cls, problem: Problem) -> "Weights":
        return cls(
            tuple(np.ones(len(block)) for block in problem.sightings),
            np.ones(len(problem.odometry.first)),
            np.ones(len(problem.surveyed)),
        )
