"""Devices that do what a test tells them to, and a robot of them; its agent only listens."""

from dataclasses import dataclass, field

import numpy as np

from robot_agent.agent import News, Report
from robot_agent.cameras.camera import Failure as CameraFailure
from robot_agent.cameras.camera import StereoPair
from robot_agent.head import Head
from robot_agent.health import Health
from robot_agent.odometry.odometry import Failure as OdometryFailure
from robot_agent.odometry.odometry import OdomPose
from robot_agent.pan_tilt.mounting import CameraPose
from robot_agent.pan_tilt.unit import Angles
from robot_agent.pan_tilt.unit import Failure as UnitFailure
from robot_agent.robot import Robot
from tagmap.records import Pose

AHEAD = Angles(0.0, 0.5)
LOST = Pose(
    T_map_base=None,
    T_map_odom=None,
    robot_session="session-0001",
    cov=None,
    map_version=None,
    gauge="floating",
    state="lost",
    dop=None,
    protection_level_m=None,
    source="agent",
    t_ns=1,
)


@dataclass
class Time:
    t_ns: int = 10**15

    def __call__(self):
        return self.t_ns


@dataclass
class Camera:
    time: Time
    failure: CameraFailure | None = None

    def grab(self, timeout_s):  # noqa: ARG002
        self.time.t_ns += 100_000_000
        if self.failure is not None:
            return self.failure
        image = np.zeros((32, 32), np.uint8)
        return StereoPair(image, image, self.time.t_ns, 0, "one")


@dataclass
class Wheels:
    """`late`: so many poses come too late."""

    time: Time
    failure: OdometryFailure | None = None
    since_ns: int | None = 0
    late: int = 0
    callbacks: list = field(default_factory=list)

    def at(self, t_ns, wait_s=0.0):  # noqa: ARG002
        if self.failure is not None or self.late > 0:
            self.late -= 1
            return None
        return OdomPose(t_ns, np.eye(4), 0, 0.0, 0.0)

    def still_since_ns(self, now_ns):  # noqa: ARG002
        return self.since_ns if self.failure is None else None

    def on_motion(self, callback):
        self.callbacks.append(callback)


@dataclass
class Unit:
    """A pan-tilt unit with its poller and its mounting in one."""

    angles: Angles = AHEAD
    failure: UnitFailure | None = None
    refuses: UnitFailure | None = None
    sent: list = field(default_factory=list)

    def move(self, angles):
        self.sent.append(angles)
        return self.refuses or angles

    def at(self, t_ns, wait_s=0.0):  # noqa: ARG002
        if self.failure is not None:
            return None
        return CameraPose(np.eye(4), 1e-6 * np.eye(6), self.angles)


@dataclass
class Listener:
    """Instead of an agent: keeps the frames, and answers what it is told to."""

    frames: list = field(default_factory=list)
    outcomes: tuple = ()
    look: Angles | None = None

    def step(self, frame, news, now_ns):  # noqa: ARG002
        self.frames.append(frame)
        return Report(None, LOST, (), self.outcomes, self.look)
        yield


def robot(*, wheels=True, unit=False, devices=None, stationary=False):
    time = Time()
    turned = Unit() if unit else None
    return Robot(
        agent=Listener(),
        cameras=Camera(time),
        mounting=turned or Unit(),
        odometer=Wheels(time) if wheels else None,
        head=Head(turned, turned) if turned else None,
        devices=devices,
        news=News,
        utc_ns=time,
        now_ns=time,
        health=Health("r1"),
        stationary=stationary,
    )
