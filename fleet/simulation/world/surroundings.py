"""What is around a robot at a time: walls, mirrors, lamps, tags, and what moves."""

from dataclasses import dataclass

import numpy as np

from fleet.simulation.scenario.fields import Size3
from fleet.simulation.world.boxes import Boxes, MovingBox, boxes
from fleet.simulation.world.history import History
from fleet.simulation.world.mirrors import Plane
from fleet.simulation.world.motion import Motion
from fleet.simulation.world.sight import Sight
from tagmap.conventions import Array


@dataclass(frozen=True, slots=True)
class Lamps:
    """p (L, 3), radius (L,) in m, level (L,) in grey levels."""

    p: Array
    radius_m: Array
    level: Array


@dataclass(frozen=True, slots=True)
class Surroundings:
    """`bodies`: of each robot by name, its motion and size. `air_seed` is that of the scene."""

    sight: Sight
    mirrors: tuple[Plane, ...]
    lamps: Lamps
    tags: History
    obstacles: tuple[MovingBox, ...]
    bodies: dict[str, tuple[Motion, Size3]]

    def moving(self, t_ns: int, robot: str) -> Boxes:
        """All that moves, apart from that robot itself."""
        parts = [
            (*box.at(t_ns), box.obstacle.size_m, box.obstacle.bottom_m) for box in self.obstacles
        ]
        for name, (motion, size) in self.bodies.items():
            if name != robot:
                parts.append((*motion.at(t_ns), size, 0.0))
        return boxes([(x, y, heading, size, bottom) for x, y, heading, size, bottom in parts])


def no_lamps() -> Lamps:
    return Lamps(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
