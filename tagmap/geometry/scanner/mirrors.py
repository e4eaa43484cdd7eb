"""Two mirrors that turn a laser beam: the beam for given mirror angles, with its Jacobian.

Source: chapter 5 of the thesis. Its full model (5.22-5.27) has two mirrors, each turning about an
axis in its own plane. In `laser` (x along the axis of mirror Y, z from it to mirror X along the
common perpendicular of both axes, y where the undeflected beam goes):

                  mirror X: axis through (0, 0, separation), along y but for the skew
                  o <------- incident ray, from +x
                  |
      z           | down to mirror Y
      |           v
      o--- x      o mirror Y: axis through the origin, along x; the beam leaves along +y

Reflection by a mirror that is turned by phi about an axis in its plane, R(phi) S R(-phi), is
R(2 phi) S, where S is the reflection by the mirror in its parallel position. So with
c = (0, 0, separation), u the axis of mirror X, S = diag(1, 1, -1) and phi_i = theta_i - neutral_i

    n = R_x(2 phi_2) S R_u(2 phi_1) S n_in
    p = R_x(2 phi_2) S (c + R_u(2 phi_1) S (p_in - c))

are the direction of the beam and a point on its line. Two things differ from the text: rays
propagate (its T = diag(-1, -1, 1) takes n_in as pointing back to the source), and the skew turns
the axis itself, u = R_z(skew) y.

Simplified model (5.29, 5.30): all parameters but the separation at their defaults. Then the beam
starts at (-d tan 2 theta_1, 0, 0) and runs along (-tan 2 theta_1, cos 2 theta_2, sin 2 theta_2).

Two parameters are pure gauge: no beam tells neutral_1 from the pitch of the incident ray (together
with its height), nor neutral_2 from a turn of the whole frame about x.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.rows import rows

PARAMETERS = (
    "separation_m",
    "skew_rad",
    "neutral_1_rad",
    "neutral_2_rad",
    "incident_y_m",
    "incident_z_m",
    "incident_yaw_rad",
    "incident_pitch_rad",
)


@dataclass(frozen=True, slots=True)
class Mirrors:
    """Parameters of the full model, in the order of PARAMETERS.

    separation     of the two axes along their common perpendicular
    skew           of the axis of mirror X from being perpendicular to that of mirror Y
    neutral_1, _2  mirror angles of X and Y at which both mirrors would be parallel
    incident       ray: where it crosses x = 0, from the axis of mirror X, and its direction
                   R_y(pitch) R_z(yaw) (-1, 0, 0)
    """

    separation_m: float
    skew_rad: float = 0.0
    neutral_1_rad: float = np.pi / 4.0
    neutral_2_rad: float = np.pi / 4.0
    incident_y_m: float = 0.0
    incident_z_m: float = 0.0
    incident_yaw_rad: float = 0.0
    incident_pitch_rad: float = 0.0

    @property
    def values(self) -> Array:
        """(8,)"""
        return np.array([getattr(self, name) for name in PARAMETERS])


@dataclass(frozen=True, slots=True)
class Beam:
    """Rays in laser: `start` (..., 3) on mirror Y, unit `direction` (..., 3), and their Jacobians
    (..., 3, 10) by the two mirror angles and PARAMETERS."""

    start: Array
    direction: Array
    start_by: Array
    direction_by: Array


def beam(mirrors: Mirrors, theta: Array) -> Beam:
    """The beam that leaves at mirror angles theta (..., 2) in rad, X first.

    NaN where the beam would not meet the face of a mirror. The start is where a flat mirror of
    any size is hit; only the line is determined by where beams end.
    """
    from tagmap.geometry.kernels.mirrors import WIDTH, beams

    rays = np.empty((*theta.shape[:-1], 2, 3, WIDTH))
    beams(mirrors.values, rows(theta), rays.reshape(-1, 2, 3, WIDTH))
    start, direction = rays[..., 0, :, :], rays[..., 1, :, :]
    return Beam(start[..., 0], direction[..., 0], start[..., 1:], direction[..., 1:])
