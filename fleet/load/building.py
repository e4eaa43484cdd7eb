"""A hall with any number of tags under its ceiling."""

import math
from dataclasses import dataclass

import numpy as np

from fleet.simulation.hall import tag_id
from tagmap.conventions import Array

CEILING_M = 3.5
JITTER_M = 0.8
ROWS_BY_COLUMNS = 0.6


@dataclass(frozen=True, slots=True)
class Building:
    """x from 0 to length, y from 0 to width; tags by id, positions (3,) in m."""

    length_m: float
    width_m: float
    tags: dict[str, Array]


def building(rng: np.random.Generator, tags: int, spacing_m: float) -> Building:
    """`tags` of them on a jittered grid."""
    rows = max(1, round(math.sqrt(ROWS_BY_COLUMNS * tags)))
    columns = math.ceil(tags / rows)
    hung = {}
    for n in range(tags):
        column, row = divmod(n, rows)
        x, y = spacing_m * (np.array([column, row]) + 0.5) + rng.uniform(-JITTER_M, JITTER_M, 2)
        hung[tag_id(n + 1)] = np.array([x, y, CEILING_M - rng.uniform(0.0, 0.5)])
    return Building(spacing_m * columns, spacing_m * rows, hung)
