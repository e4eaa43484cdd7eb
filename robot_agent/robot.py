"""The agent with its devices: grab, know where camera and base are, step, obey what it says."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from robot_agent.activation.commands import Act
from robot_agent.activation.runner import Devices, carry_out
from robot_agent.agent import Agent, Frame, News, Report
from robot_agent.cameras.camera import Failure as CameraFailure
from robot_agent.cameras.camera import StereoCamera, StereoPair
from robot_agent.head import Head
from robot_agent.health import Health
from robot_agent.laser.interlock import DeviceFailed
from robot_agent.odometry.odometry import Odometer, OdomPose
from robot_agent.pan_tilt.mounting import CameraPose, Mounting
from tagmap.conventions import Array

WAIT_S = 0.15
"""For the readings of head and wheels that follow an exposure."""
UNKNOWN = 3
"""Exposures in a row whose readings come too late: a single one is passed over, for without
odometry every name and the pose would be forgotten."""


@dataclass(slots=True)
class Pointing:
    """Where the camera was at the latest exposure, which the laser rides with; None: not known."""

    T_base_cam: Array | None = None

    def __call__(self) -> Array:
        return np.full((4, 4), np.nan) if self.T_base_cam is None else self.T_base_cam


@dataclass(slots=True)
class Robot:
    """`devices` None: there is no laser or no reader. `news` tells what came from the service;
    `utc_ns` is the clock of exposures and odometry, `now_ns` that of the interlock."""

    agent: Agent
    cameras: StereoCamera
    mounting: Mounting
    odometer: Odometer | None
    head: Head | None
    devices: Devices | None
    news: Callable[[], News]
    utc_ns: Callable[[], int]
    now_ns: Callable[[], int]
    health: Health
    grab_s: float = 1.0
    stationary: bool = False
    pointing: Pointing = field(default_factory=Pointing)
    failure: CameraFailure | None = None
    _unknown: int = 0

    def cycle(self) -> Report | None:
        """None: there was no exposure, or it is not known where camera or robot were."""
        self.health.write()
        pair = self.cameras.grab(self.grab_s)
        self.failure = pair if isinstance(pair, CameraFailure) else None
        if isinstance(pair, CameraFailure):
            if pair.reason != "ended":
                self.health.note("cameras", f"{pair.reason}: {pair.detail}")
            return None
        self.health.note("cameras", None)
        camera = self.mounting.at(pair.t_ns, WAIT_S)
        if self.head is not None:
            self.health.note("pan-tilt", self.head.trouble(camera))
        if camera is None:
            return None
        self.pointing.T_base_cam = camera.T_base_cam
        odom = self._odom(pair.t_ns)
        if 0 < self._unknown < UNKNOWN:
            return None
        frame = self._frame(pair, camera, odom)
        report = self._carried_out(self.agent.step(frame, self.news(), self.now_ns()))
        self._note_shots(report)
        if self.head is not None and report.look is not None:
            if self.devices is not None:
                self.devices.interlock.moved()
            self.head.turn(report.look, self.now_ns())
        return report

    def _frame(self, pair: StereoPair, camera: CameraPose, odom: OdomPose | None) -> Frame:
        is_still = stands = self._stands(pair.t_ns, odom)
        if self.head is not None:
            is_still &= self.head.is_still(camera.angles, self.now_ns())
        return Frame(pair, camera, odom, stands, is_still)

    def _odom(self, t_ns: int) -> OdomPose | None:
        if self.odometer is None:
            return None
        pose = self.odometer.at(t_ns, WAIT_S)
        failure = self.odometer.failure
        self._unknown = self._unknown + 1 if pose is None and failure is None else 0
        if failure is not None:
            self.health.note("odometry", failure.detail)
        elif pose is not None:
            self.health.note("odometry", None)
        elif self._unknown >= UNKNOWN:
            self.health.note("odometry", "no readings around the times of exposures")
        return pose

    def _stands(self, t_ns: int, odom: OdomPose | None) -> bool:
        """Since before the exposure, and still so. An exposure that no reading belongs to may be of
        another time than it says."""
        if self.odometer is None:
            return self.stationary
        if odom is None:
            return False
        since_ns = self.odometer.still_since_ns(self.utc_ns())
        return since_ns is not None and since_ns <= t_ns

    def _carried_out(self, act: Act[Report]) -> Report:
        if self.devices is not None:
            return carry_out(act, self.devices)
        try:
            next(act)
        except StopIteration as end:
            report: Report = end.value
            return report
        raise AssertionError("an agent without a laser asks for nothing")

    def _note_shots(self, report: Report) -> None:
        """A device that fails makes shots time out, and so does a permit that ends early, which is
        no device's fault. A shot that comes to an end shows that both work."""
        if any(o.verdict.kind != "timeout" for o in report.outcomes):
            self.health.note("laser and reader", None)
            return
        failed = [o.verdict.reason for o in report.outcomes]
        if broken := [reason for reason in failed if isinstance(reason, DeviceFailed)]:
            self.health.note("laser and reader", broken[-1])
