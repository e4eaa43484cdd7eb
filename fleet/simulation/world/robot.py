"""One robot of the world: what it is told about itself, and what is true."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from fleet.simulation.scenario.description import Scenario
from fleet.simulation.scenario.robot import Robot
from fleet.simulation.world.chances import stream
from fleet.simulation.world.clock import RobotClock
from fleet.simulation.world.floor import Floor
from fleet.simulation.world.imager import Imager
from fleet.simulation.world.laser import WorldLaser
from fleet.simulation.world.motion import Motion, Stop
from fleet.simulation.world.odometry import DeadReckoning
from fleet.simulation.world.rig import Mount
from fleet.simulation.world.shining import Eye, View, lights
from fleet.simulation.world.surroundings import Surroundings
from robot_agent.cameras.camera import StereoPair
from robot_agent.pan_tilt.unit import Angles
from robot_agent.perception.spots import Image
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.scanner.drive import Drive
from tagmap.geometry.scanner.scanner import Scanner
from tagmap.geometry.stereo import StereoRig
from tagmap.records.hello import CalibrationSigmas, Introduction, Limits
from tagmap.records.rig import RigCalibration
from tagmap.records.scanner import ScannerCalibration

AnglesAt = Callable[[int], Angles]
Images: TypeAlias = tuple[Image, Image]
Frame: TypeAlias = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Known:
    """What a robot's own files say; its programs may have all of it."""

    rig: RigCalibration
    scanner: ScannerCalibration
    drive: Drive
    mount: Mount
    sigmas: CalibrationSigmas
    limits: Limits

    @property
    def introduction(self) -> Introduction:
        return Introduction(
            kind="spatial", rig=self.rig, limits=self.limits, calibration=self.sigmas
        )


@dataclass(frozen=True, slots=True)
class Hidden:
    """What is true instead: for the world itself and for evaluation."""

    rig: StereoRig
    scanner: Scanner
    mount: Mount
    motion: Motion
    floor: Floor


@dataclass(slots=True)
class WorldRobot:
    """Times are of the world but for those of a StereoPair; any thread may ask."""

    name: str
    number: int
    table: Robot
    known: Known
    hidden: Hidden
    clock: RobotClock
    wheels: DeadReckoning
    laser: WorldLaser
    around: Surroundings
    scenario: Scenario
    seed: int
    eyes: tuple[Eye, Eye]
    imagers: tuple[Imager, Imager]
    _stood: tuple[tuple[float, float, float], Array] | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def rig(self) -> RigCalibration:
        return self.known.rig

    @property
    def scanner(self) -> ScannerCalibration:
        return self.known.scanner

    @property
    def stops(self) -> tuple[Stop, ...]:
        """When and where it stands, in order of time."""
        return self.hidden.motion.stops()

    def T_map_base(self, t_ns: int) -> Array:
        """(4, 4), the truth. Where it was asked for last it mostly still stands."""
        at = self.hidden.motion.at(t_ns)
        stood = self._stood
        if stood is None or stood[0] != at:
            self._stood = stood = at, self.hidden.floor.stand(*at)
        return stood[1]

    def T_map_cam(self, t_ns: int, angles: Angles | None = None) -> Array:
        """(4, 4), the truth; angles: of its pan-tilt unit, None: at 0, or there is none."""
        return self.T_map_base(t_ns) @ self.hidden.mount.T_base_cam(angles)

    def is_moving(self, t_ns: int) -> bool:
        return self.hidden.motion.is_moving(t_ns)

    def odometry(self, t_ns: int) -> tuple[int, float, float, float]:
        """Epoch, and dead reckoning from its start: x, y in m, theta in rad."""
        return self.wheels.at(t_ns)

    def clock_ns(self, t_ns: int) -> int:
        """What the robot's clock says."""
        return self.clock.robot_ns(t_ns)

    def world_ns(self, robot_ns: int) -> int:
        """When the robot's clock says so."""
        return self.clock.world_ns(robot_ns)

    def pair(self, t_ns: int, angles_at: AnglesAt | None = None) -> StereoPair:
        """Images whose exposure has its middle at `t_ns`, the right one's a little later. The time
        in the pair is by the robot's clock."""
        return self.paired(t_ns, self.images(t_ns, angles_at))

    def images(
        self,
        t_ns: int,
        angles_at: AnglesAt | None = None,
        onto: tuple[Frame | None, Frame | None] = (None, None),
    ) -> Images:
        """Of `pair`; onto frames where there are any."""
        with self._lock:
            left = self._image(0, t_ns, angles_at, onto[0])
            right = self._image(1, t_ns + self._skew_ns, angles_at, onto[1])
        return left, right

    def paired(self, t_ns: int, images: Images) -> StereoPair:
        """Those of `t_ns`, as the robot's cameras hand them out."""
        return StereoPair(*images, self.clock_ns(t_ns), self._skew_ns, f"{self.name}-{t_ns}")

    @property
    def _skew_ns(self) -> int:
        return round(self.scenario.optics.skew_s * 1e9)

    def _image(self, side: int, t_ns: int, angles_at: AnglesAt | None, onto: Frame | None) -> Image:
        optics = self.scenario.optics
        half_ns = round(0.5e9 * optics.exposure_s)
        view = self._view(side, (t_ns - half_ns, t_ns, t_ns + half_ns), angles_at)
        seen = lights(
            self.eyes[side], view, self.around, self.name, t_ns, self.scenario.led, optics
        )
        rng = stream(self.seed, "image", self.name, side, t_ns)
        return self.imagers[side].expose(seen, rng, onto)

    def _view(self, side: int, times: tuple[int, int, int], angles_at: AnglesAt | None) -> View:
        """Poses that do not change are computed once."""
        angles = [angles_at(t) if angles_at else None for t in times]
        middle = self._eye_pose(side, times[1], angles[1])
        if angles[0] == angles[2] and not any(self.is_moving(t) for t in times):
            return View(middle, middle, middle)
        ends = (self._eye_pose(side, times[k], angles[k]) for k in (0, 2))
        return View(next(ends), middle, next(ends))

    def _eye_pose(self, side: int, t_ns: int, angles: Angles | None) -> Array:
        T_map_cam = self.T_map_cam(t_ns, angles)
        if side == 0:
            return T_map_cam
        T_map_right: Array = T_map_cam @ se3.inverse(self.hidden.rig.T_right_left)
        return T_map_right


def no_angles(_t_ns: int) -> Angles:
    return Angles(0.0, 0.0)


def half_diagonal_m(robot: Robot) -> float:
    """Of its body on the floor."""
    return 0.5 * float(np.hypot(robot.body_m[0], robot.body_m[1]))
