"""A hall with tags under its ceiling and high on its end walls."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array

COLUMNS, ROWS = 6, 4
EPC_PREFIX = 0xE2004700 << 64


@dataclass(frozen=True, slots=True)
class Hall:
    """x from 0 to length, y from 0 to width, floor at z = 0; tags by id, positions (3,) in m.

    `surveyed`: the tags near the corners, which anchor the map.
    """

    length_m: float
    width_m: float
    height_m: float
    tags: dict[str, Array]
    surveyed: tuple[str, ...]


def hall(rng: np.random.Generator, length_m: float = 20.0, width_m: float = 12.0) -> Hall:
    """24 tags on a jittered grid: the outer columns hang on the walls, the rest at the ceiling."""
    height_m = 3.2
    tags: dict[str, Array] = {}
    for column in range(COLUMNS):
        for row in range(ROWS):
            jitter = rng.uniform(-0.8, 0.8, 2)
            x, y = np.array([column, row + 0.5]) * [length_m / (COLUMNS - 1), width_m / ROWS]
            if column in (0, COLUMNS - 1):
                p = np.array([x, y + jitter[1], rng.uniform(2.0, 2.8)])
            else:
                p = np.array([x + jitter[0], y + jitter[1], height_m - rng.uniform(0.0, 0.3)])
            tags[tag_id(column * ROWS + row + 1)] = p
    corners = (1, ROWS, (COLUMNS - 1) * ROWS + 1, COLUMNS * ROWS)
    return Hall(length_m, width_m, height_m, tags, tuple(tag_id(n) for n in corners))


def tag_id(number: int) -> str:
    """A 96-bit EPC."""
    return f"{EPC_PREFIX + number:024x}"
