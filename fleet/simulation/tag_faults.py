"""Views with tags that are not what or where the map says."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np

from fleet.simulation.views import Places
from tagmap.conventions import Array, Mask

Fault: TypeAlias = Literal["none", "moved", "wrong", "swapped"]
FAULTS: tuple[Fault, ...] = get_args(Fault)

_NEAR_M, _FAR_M = 0.005, 3.0
_ROOM_M = 4.0


@dataclass(frozen=True, slots=True)
class Mapped:
    """p_map (S, N, 3) as the map has it, the tags of which that is not true (S, N), and how far
    they are from where the map has them, size_m (S,)."""

    p_map: Array
    faulty: Mask
    size_m: Array


def mapped(rng: np.random.Generator, true: Places, fault: Fault) -> Mapped:
    """One fault in each view.

    moved    a tag by 5 mm to 3 m, evenly in the logarithm, in any direction
    wrong    a tag has another one's name, which hangs anywhere within 4 m
    swapped  two tags have each other's names
    """
    p, (count, n) = true.p_map.copy(), true.p_map.shape[:2]
    faulty, each = np.zeros((count, n), dtype=bool), np.arange(count)
    i = rng.integers(0, n, count)
    j = (i + rng.integers(1, n, count)) % n
    if fault == "moved":
        direction = rng.standard_normal((count, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        size = np.exp(rng.uniform(np.log(_NEAR_M), np.log(_FAR_M), (count, 1)))
        p[each, i] += size * direction
    if fault == "wrong":
        p[each, i] += rng.uniform(-_ROOM_M, _ROOM_M, (count, 3))
    if fault == "swapped":
        p[each, i], p[each, j] = true.p_map[each, j], true.p_map[each, i]
        faulty[each, j] = True
    faulty[each, i] = fault != "none"
    return Mapped(p, faulty, np.linalg.norm(p[each, i] - true.p_map[each, i], axis=-1))
