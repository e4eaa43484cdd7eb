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

from dataclasses import astuple, dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import so3

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
X, Y, Z = np.eye(3)
MIRRORED = np.array([1.0, 1.0, -1.0])
_COLUMNS = 2 + len(PARAMETERS)


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
        return np.array(astuple(self))


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
    phi = theta - np.array([mirrors.neutral_1_rad, mirrors.neutral_2_rad])
    n1, p1, n1_by, p1_by = _after_x(mirrors, phi[..., 0])
    return _after_y(phi[..., 1], n1, p1, n1_by, p1_by)


def _after_x(mirrors: Mirrors, phi: Array) -> tuple[Array, Array, Array, Array]:
    """Direction and a point of the ray between the mirrors, and their Jacobians."""
    lift, u = mirrors.separation_m * Z, _turn(Z, mirrors.skew_rad) @ Y
    R = _turn(u, 2.0 * phi)
    n_in, n_by_yaw, n_by_pitch = _incident(mirrors)
    from_axis = MIRRORED * np.array([0.0, mirrors.incident_y_m, mirrors.incident_z_m])
    n, p = R @ (MIRRORED * n_in), R @ from_axis
    n_by, p_by = np.zeros((*n.shape, _COLUMNS)), np.zeros((*n.shape, _COLUMNS))
    for image, mirrored, by in ((n, MIRRORED * n_in, n_by), (p, from_axis, p_by)):
        by[..., 0] = 2.0 * np.cross(u, image)
        by[..., 3] = np.cross(Z, image) - R @ np.cross(Z, mirrored)
        by[..., 4] = -by[..., 0]
    p_by[..., 2] = Z
    p_by[..., 6], p_by[..., 7] = R @ Y, R @ -Z
    n_by[..., 8], n_by[..., 9] = R @ (MIRRORED * n_by_yaw), R @ (MIRRORED * n_by_pitch)
    # The face of mirror X looks down to mirror Y when both are parallel.
    face = _turn(u, phi) @ -Z
    n = np.where(((face @ n_in) < 0.0)[..., None], n, np.nan)
    return n, lift + p, n_by, p_by


def _after_y(phi: Array, n1: Array, p1: Array, n1_by: Array, p1_by: Array) -> Beam:
    R = _turn(X, 2.0 * phi) * MIRRORED
    face = _turn(X, phi) @ Z
    n, p = _apply(R, n1), _apply(R, p1)
    n_by, p_by, face_by = R @ n1_by, R @ p1_by, np.zeros_like(n1_by)
    for image, by, rate in ((n, n_by, 2.0), (p, p_by, 2.0), (face, face_by, 1.0)):
        by[..., 1] = rate * np.cross(X, image)
        by[..., 5] = -by[..., 1]
    # The mirror image of the ray meets the mirror where the ray does.
    leaves = _dot(n, face)
    n = np.where((leaves > 0.0)[..., None], n, np.nan)
    along = (-_dot(p, face) / leaves)[..., None]
    start = p + along * n
    off_plane = (p_by + along[..., None] * n_by) * face[..., None] + start[..., None] * face_by
    along_by = -off_plane.sum(axis=-2) / leaves[..., None]
    start_by = p_by + along[..., None] * n_by + n[..., None] * along_by[..., None, :]
    return Beam(start, n, start_by, n_by)


def _incident(mirrors: Mirrors) -> tuple[Array, Array, Array]:
    """Direction (3,) of the incident ray, and its derivatives by yaw and by pitch."""
    pitch, yaw = _turn(Y, mirrors.incident_pitch_rad), _turn(Z, mirrors.incident_yaw_rad)
    n = pitch @ yaw @ -X
    return n, pitch @ np.cross(Z, yaw @ -X), np.cross(Y, n)


def _turn(axis: Array, angle: Array | float) -> Array:
    """Rotation (..., 3, 3) about a unit axis (3,) by angles (...)."""
    return so3.exp(np.asarray(angle)[..., None] * axis)


def _apply(R: Array, v: Array) -> Array:
    image: Array = (R @ v[..., None])[..., 0]
    return image


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(axis=-1)
    return product
