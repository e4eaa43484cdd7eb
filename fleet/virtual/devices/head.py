"""A pan-tilt unit: the axes of the emulated one, read as often as the agent's poller does."""

import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass, field

from fleet.emulation.pan_tilt.axis import Axis
from fleet.emulation.pan_tilt.unit import d46_axes
from fleet.virtual.devices.time import RobotTime
from robot_agent.pan_tilt.track import Pointing, PointingTrack
from robot_agent.pan_tilt.unit import (
    Angles,
    AxisReach,
    AxisSample,
    Failure,
    PanTilt,
    Reading,
    UnitInfo,
)

TICK_NS, READ_EVERY = 10_000_000, 3
WITHIN_NS = 2_000_000
KEPT = 1024
ARCSEC = math.pi / 180.0 / 3600.0


@dataclass(slots=True)
class WorldHead(PanTilt):
    """Also what a `Turning` asks of a poller. Angles of the past are exact for the cameras, and in
    steps, at uncertain times, for the agent."""

    time: RobotTime
    failure: Failure | None = None
    _axes: dict[str, Axis] = field(default_factory=d46_axes)
    _track: PointingTrack = field(default_factory=PointingTrack)
    _past: deque[tuple[int, float, float]] = field(default_factory=lambda: deque(maxlen=KEPT))
    _ticks: int = 0
    _next_ns: int = 0

    def __post_init__(self) -> None:
        self._next_ns = self.time.world_ns()
        self.time.watchers.append(self.catch_up)
        self.catch_up()

    def catch_up(self) -> None:
        while self._next_ns <= self.time.world_ns():
            self._tick(self._next_ns)
            self._next_ns += TICK_NS

    def angles_at(self, world_ns: int) -> Angles:
        """The truth, for cameras and laser."""
        self.catch_up()
        k = bisect_right(self._past, world_ns, key=lambda one: one[0])
        a, b = self._past[max(k - 1, 0)], self._past[min(k, len(self._past) - 1)]
        s = 0.0 if b[0] == a[0] else (world_ns - a[0]) / (b[0] - a[0])
        return Angles(a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]))

    def at(self, t_ns: int, wait_s: float = 0.0) -> Pointing | None:
        """By the robot's clock, as robot_agent.pan_tilt.poller.Poller."""
        until_ns = self.time.world_ns() + round(1e9 * wait_s)
        self.catch_up()
        while not self._track.reaches(t_ns) and self.time.world_ns() < until_ns:
            self.time.wait_world_until(min(self._next_ns, until_ns))
        return self._track.at(t_ns)

    def probe(self) -> UnitInfo | Failure:
        return UnitInfo("simulated", "simulated", *(_reach(self._axes[name]) for name in "PT"))

    def move(self, angles: Angles) -> Angles | Failure:
        self.catch_up()
        for name, angle_rad in (("P", angles.pan_rad), ("T", angles.tilt_rad)):
            axis = self._axes[name]
            target = round(angle_rad / (axis.arcsec * ARCSEC))
            if not axis.least <= target <= axis.most:
                return Failure("out_of_reach", f"{name} {angle_rad:.3f} rad")
            axis.target = target
        return Angles(*(self._rad(name, self._axes[name].target) for name in "PT"))

    def read(self) -> Reading | Failure:
        self.catch_up()
        return self._reading(self.time.world_ns())

    def set_speed(self, speed_rad_s: float) -> Failure | None:
        for axis in self._axes.values():
            axis.speed = round(speed_rad_s / (axis.arcsec * ARCSEC))
        return None

    def halt(self) -> Failure | None:
        for axis in self._axes.values():
            axis.halt()
        return None

    def close(self) -> None:
        self.time.watchers.remove(self.catch_up)

    def _tick(self, world_ns: int) -> None:
        if self._past:
            for axis in self._axes.values():
                axis.turn(TICK_NS)
        pan_rad, tilt_rad = (self._rad(n, self._axes[n].position) for n in "PT")
        self._past.append((world_ns, pan_rad, tilt_rad))
        if self._ticks % READ_EVERY == 0:
            self._track.add(self._reading(world_ns))
        self._ticks += 1

    def _reading(self, world_ns: int) -> Reading:
        t_ns = self.time.robot.clock_ns(world_ns)
        samples = [
            AxisSample(
                t_ns,
                WITHIN_NS,
                self._rad(name, round(self._axes[name].position)),
                self._axes[name].arcsec * ARCSEC,
            )
            for name in "PT"
        ]
        return Reading(*samples)

    def _rad(self, name: str, position: float) -> float:
        return position * self._axes[name].arcsec * ARCSEC


def _reach(axis: Axis) -> AxisReach:
    step_rad = axis.arcsec * ARCSEC
    return AxisReach(
        axis.least * step_rad,
        axis.most * step_rad,
        step_rad,
        axis.upper * step_rad,
        axis.acceleration * step_rad,
    )
