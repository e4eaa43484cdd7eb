"""Where the camera is on the robot at the time of an exposure: fixed, or turned by a unit."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robot_agent.pan_tilt.track import Pointing
from robot_agent.pan_tilt.unit import Angles, Failure
from tagmap.conventions import Array
from tagmap.geometry import pan_tilt
from tagmap.geometry.pan_tilt import PanTiltMount


@dataclass(frozen=True, slots=True)
class CameraPose:
    """T_base_cam (4, 4), and its covariance (6, 6) in cam axes as far as the angles are uncertain;
    None of a camera that is fixed. angles: None likewise. rests: it did not turn meanwhile."""

    T_base_cam: Array
    cov: Array | None
    angles: Angles | None
    rests: bool = True


class Angling(Protocol):
    """Angles at any time, as robot_agent.pan_tilt.poller.Poller tells them."""

    @property
    def failure(self) -> Failure | None: ...

    def at(self, t_ns: int, wait_s: float = 0.0) -> Pointing | None: ...


class Mounting(Protocol):
    def at(self, t_ns: int, wait_s: float = 0.0) -> CameraPose | None:
        """At `t_ns` (UTC). None: it is not known, even after `wait_s`."""


@dataclass(frozen=True, slots=True)
class Fixed(Mounting):
    T_base_cam: Array

    def at(self, t_ns: int, wait_s: float = 0.0) -> CameraPose | None:  # noqa: ARG002
        return CameraPose(self.T_base_cam, None, None)


@dataclass(frozen=True, slots=True)
class Turning(Mounting):
    """By a unit that somebody polls."""

    mount: PanTiltMount
    poller: Angling

    def at(self, t_ns: int, wait_s: float = 0.0) -> CameraPose | None:
        """The reading behind `t_ns` comes a period later, so a fresh exposure has to wait."""
        pointing = self.poller.at(t_ns, wait_s)
        if pointing is None:
            return None
        angles_rad = np.array([pointing.angles.pan_rad, pointing.angles.tilt_rad])
        sigma_rad = np.array([pointing.sigma_pan_rad, pointing.sigma_tilt_rad])
        return CameraPose(
            pan_tilt.camera_pose(self.mount, angles_rad),
            pan_tilt.covariance(self.mount, angles_rad, sigma_rad),
            pointing.angles,
            pointing.rests,
        )
