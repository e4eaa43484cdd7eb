"""Where a robot's laser beam goes, and which tags it switches on."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fleet.simulation.scenario.physics import Laser
from fleet.simulation.scene.scene import Scene
from fleet.simulation.world.mirrors import apparent, shown
from fleet.simulation.world.surroundings import Surroundings
from robot_agent.laser.device import Steps
from robot_agent.pan_tilt.unit import Angles
from tagmap.conventions import Array, Mask
from tagmap.geometry import se3
from tagmap.geometry.scanner.drive import Drive, angles_of
from tagmap.geometry.scanner.scanner import Scanner, point

AnglesAt = Callable[[int], Angles]


@dataclass(frozen=True, slots=True)
class WorldLaser:
    """`scanner` as it is. T_map_cam (4, 4) at a time of the world, with the unit's angles."""

    name: str
    scanner: Scanner
    drive: Drive
    beam: Laser
    around: Surroundings
    T_map_cam: Callable[[int, Angles | None], Array]

    def lit(self, steps: Steps, t_ns: int, angles: Angles | None = None) -> list[str]:
        """Names of the tags that the beam of these steps switches on."""
        T_map_cam = self.T_map_cam(t_ns, angles)
        now = self.around.tags.at(t_ns)
        seen = apparent(now.p, now.normal, self.around.mirrors)
        p_cam = se3.act(se3.inverse(T_map_cam), seen.p)
        theta = angles_of(self.drive, np.array(steps))
        with np.errstate(invalid="ignore", divide="ignore"):
            there = point(self.scanner, np.broadcast_to(theta, (len(p_cam), 2)), p_cam)
            off_m = np.sqrt((there.off**2).sum(axis=-1))
            origin = self.origin(T_map_cam)
            way = origin - seen.p
            cosine = (way * seen.normal).sum(-1) / np.linalg.norm(way, axis=-1)
            hit = self.enough(off_m, there.ahead, cosine) & now.open[seen.source]
        seen = seen.only(hit)
        moving = self.around.moving(t_ns, self.name)
        clear = shown(origin, seen, now.p, self.around.mirrors, self.around.sight, moving)
        return [self.around.tags.names[k] for k in dict.fromkeys(seen.source[clear].tolist())]

    def origin(self, T_map_cam: Array) -> Array:
        """(3,) about where the beam leaves the last mirror."""
        return se3.act(T_map_cam, self.scanner.T_cam_laser[:3, 3])

    def enough(self, off_m: Array, ahead_m: Array, cosine: Array) -> Mask:
        """(K,) whether the light suffices: that of a Gaussian beam where the photodiode, a disc, is
        nearest to its middle, by the cosine of how aslant it comes in."""
        beam = self.beam
        w = np.sqrt(beam.beam_m**2 + (beam.divergence_rad * ahead_m) ** 2)
        beside = np.maximum(off_m - beam.photodiode_m, 0.0)
        middle = 2.0 * beam.power_w / (np.pi * w * w)
        light = middle * np.exp(-2.0 * (beside / w) ** 2) * cosine
        accepted = cosine >= np.cos(np.deg2rad(beam.acceptance_deg))
        found: Mask = (ahead_m > 0.0) & accepted & (light >= beam.least_w_m2)
        return found

    def at(self, now_ns: Callable[[], int], angles_at: AnglesAt | None = None) -> "LaserNow":
        """For a device that knows the time by itself; `now_ns` is that of the world."""
        return LaserNow(self, now_ns, angles_at)


@dataclass(frozen=True, slots=True)
class LaserNow:
    """As `fleet.simulation.scene.laser.TrueLaser` for those who steer it."""

    laser: WorldLaser
    now_ns: Callable[[], int]
    angles_at: AnglesAt | None

    @property
    def name(self) -> str:
        return self.laser.name

    @property
    def drive(self) -> Drive:
        return self.laser.drive

    def on(self, _scene: Scene, steps: Steps) -> list[str]:
        """Names of the tags on which the beam of these steps is now."""
        t_ns = self.now_ns()
        return self.laser.lit(steps, t_ns, self.angles_at(t_ns) if self.angles_at else None)
