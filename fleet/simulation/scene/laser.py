"""Which tags a laser's beam is on: the one place that knows the true scanner."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fleet.simulation.scene.scene import Scene
from robot_agent.laser.device import Steps
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.scanner.drive import Drive, angles_of
from tagmap.geometry.scanner.scanner import Scanner, point


@dataclass(slots=True)
class TrueLaser:
    """`scanner` and `drive` as they are, not as they were calibrated.

    T_map_cam   (4, 4) at this moment
    reach_m     a tag is lit when the middle of the beam passes it that near
    range_m     and it is not farther away
    blocked     tags that something hides from the laser, though perhaps not from the cameras
    """

    name: str
    scanner: Scanner
    drive: Drive
    T_map_cam: Callable[[], Array]
    reach_m: float = 0.02
    range_m: float = 30.0
    blocked: set[str] = field(default_factory=set)

    def on(self, scene: Scene, steps: Steps) -> list[str]:
        """Names of the tags on which the beam of these steps is."""
        seen = [tag for tag in scene.tags if tag.name not in self.blocked]
        if not seen:
            return []
        p_map = np.array([tag.p_map for tag in seen])
        p_cam = se3.act(se3.inverse(self.T_map_cam()), p_map)
        theta = angles_of(self.drive, np.array(steps))
        there = point(self.scanner, np.broadcast_to(theta, (len(seen), 2)), p_cam)
        off_m = np.sqrt((there.off**2).sum(axis=-1))
        with np.errstate(invalid="ignore"):
            hit = (off_m <= self.reach_m) & (there.ahead > 0.0) & (there.ahead <= self.range_m)
        return [tag.name for tag, is_hit in zip(seen, hit.tolist(), strict=True) if is_hit]
