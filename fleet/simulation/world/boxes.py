"""Boxes that move: obstacles and the bodies of robots, tested one by one against straight lines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fleet.simulation.scenario.building import Obstacle
from fleet.simulation.world.looking import block
from tagmap.conventions import Array, Mask


@dataclass(frozen=True, slots=True)
class Boxes:
    """Upright: centre (B, 3), half sizes (B, 3) in m, heading (B,) in rad."""

    centre: Array
    half: Array
    heading: Array

    def __len__(self) -> int:
        return len(self.heading)

    def block(self, origin: Array, target: Array) -> Mask:
        """(K,) whether anything is between origins (K, 3) or (3,) and targets (K, 3)."""
        blocked, start = np.zeros(len(target), dtype=bool), np.empty(target.shape)
        start[:] = origin
        block(self.centre, self.half, self.heading, start, np.ascontiguousarray(target), blocked)
        return blocked


def boxes(parts: Sequence[tuple[float, float, float, tuple[float, float, float], float]]) -> Boxes:
    """Of (x, y, heading, size, bottom)."""
    if not parts:
        return Boxes(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    rows = np.array([[x, y, bottom + 0.5 * size[2], *size, h] for x, y, h, size, bottom in parts])
    return Boxes(rows[:, :3].copy(), 0.5 * rows[:, 3:6], rows[:, 6].copy())


@dataclass(frozen=True, slots=True)
class MovingBox:
    """An obstacle that goes along its path and back for ever, from `start_ns` on."""

    obstacle: Obstacle
    start_ns: int
    way_m: Array
    """(N,) along the path at each of its points."""

    def at(self, t_ns: int) -> tuple[float, float, float]:
        """x, y, heading (along the path)."""
        path, length = np.array(self.obstacle.path_m), float(self.way_m[-1])
        if length == 0.0:
            return (*self.obstacle.path_m[0], 0.0)
        gone = self.obstacle.speed_m_s * max(0, t_ns - self.start_ns) * 1e-9
        gone = length - abs(length - gone % (2.0 * length))
        k = int(np.clip(np.searchsorted(self.way_m, gone, "right") - 1, 0, len(path) - 2))
        step = path[k + 1] - path[k]
        x, y = path[k] + (gone - self.way_m[k]) / max(np.hypot(*step), 1e-9) * step
        return float(x), float(y), float(np.arctan2(step[1], step[0]))


def moving_box(obstacle: Obstacle, start_ns: int) -> MovingBox:
    steps = np.hypot(*np.diff(np.array(obstacle.path_m), axis=0).T)
    return MovingBox(obstacle, start_ns, np.concatenate([[0.0], np.cumsum(steps)]))
