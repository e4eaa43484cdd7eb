"""Beams of two mirrors, compiled: the model is told in tagmap.geometry.scanner.mirrors.

A ray is an array (2, 3, 11), of a point on it and of its direction, each with its derivatives: of
the vectors the columns are the value, that by both mirror angles, and those by PARAMETERS. A turn
turns them all alike, and adds to one column what the vector moves by when the angle changes.
"""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled

WIDTH = 11
_THETA_1, _THETA_2, _SEPARATION, _SKEW, _NEUTRAL_1, _NEUTRAL_2 = 1, 2, 3, 4, 5, 6
_INCIDENT_Y, _INCIDENT_Z, _YAW, _PITCH = 7, 8, 9, 10
_X, _Y, _Z = 0, 1, 2


@compiled
def beams(mirrors: Array, theta: Array, rays: Array) -> None:
    """Rays (N, 2, 3, 11) of mirrors (8,), in the order of PARAMETERS, at angles (N, 2)."""
    for i in range(len(theta)):
        beam(mirrors, theta[i, 0], theta[i, 1], rays[i])


@compiled
def beam(mirrors: Array, theta_1: float, theta_2: float, ray: Array) -> None:
    """From where it leaves mirror Y; NaN where it would not meet the face of a mirror."""
    separation, skew, neutral_1, neutral_2 = mirrors[0], mirrors[1], mirrors[2], mirrors[3]
    phi_1, phi_2 = theta_1 - neutral_1, theta_2 - neutral_2
    _incident(mirrors, ray)
    # The face of mirror X looks down to mirror Y when both are parallel.
    aside = math.sin(skew) * ray[1, _Y, 0] + math.cos(skew) * ray[1, _X, 0]
    meets = math.sin(phi_1) * aside + math.cos(phi_1) * ray[1, _Z, 0] > 0.0
    _mirror(ray)
    _turn(ray, _X, _Y, -skew, _SKEW, -1.0)
    _turn(ray, _Z, _X, 2.0 * phi_1, _THETA_1, 2.0)
    _turn(ray, _X, _Y, skew, _SKEW, 1.0)
    ray[0, _Z, 0] += separation
    ray[0, _Z, _SEPARATION] = 1.0
    _mirror(ray)
    _turn(ray, _Y, _Z, 2.0 * phi_2, _THETA_2, 2.0)
    leaves = _to_face(ray, phi_2)
    for i in range(2):
        for j in range(3):
            ray[i, j, _NEUTRAL_1] = -ray[i, j, _THETA_1]
            ray[i, j, _NEUTRAL_2] = -ray[i, j, _THETA_2]
            if not (meets and leaves):
                for k in range(WIDTH):
                    ray[i, j, k] = math.nan


@compiled
def _incident(mirrors: Array, ray: Array) -> None:
    """From the axis of mirror X."""
    for i in range(2):
        for j in range(3):
            for k in range(WIDTH):
                ray[i, j, k] = 0.0
    ray[1, _X, 0] = -1.0
    _turn(ray, _X, _Y, mirrors[6], _YAW, 1.0)
    _turn(ray, _Z, _X, mirrors[7], _PITCH, 1.0)
    ray[0, _Y, 0], ray[0, _Z, 0] = mirrors[4], mirrors[5]
    ray[0, _Y, _INCIDENT_Y] = ray[0, _Z, _INCIDENT_Z] = 1.0


@compiled
def _mirror(ray: Array) -> None:
    """By a mirror in its parallel position."""
    for i in range(2):
        for k in range(WIDTH):
            ray[i, _Z, k] = -ray[i, _Z, k]


@compiled
def _turn(ray: Array, a: int, b: int, angle: float, column: int, rate: float) -> None:
    """By `angle` from axis a towards axis b, which changes by `rate` with that column."""
    c, s = math.cos(angle), math.sin(angle)
    for i in range(2):
        for k in range(WIDTH):
            x, y = ray[i, a, k], ray[i, b, k]
            ray[i, a, k], ray[i, b, k] = c * x - s * y, s * x + c * y
        ray[i, a, column] -= rate * ray[i, b, 0]
        ray[i, b, column] += rate * ray[i, a, 0]


@compiled
def _to_face(ray: Array, phi: float) -> bool:
    """The mirror image of a ray meets the mirror where the ray does: its point goes there. False
    where it leaves on the back."""
    y, z = -math.sin(phi), math.cos(phi)
    leaves = ray[1, _Y, 0] * y + ray[1, _Z, 0] * z
    along = -(ray[0, _Y, 0] * y + ray[0, _Z, 0] * z) / leaves
    for j in range(3):
        ray[0, j, 0] += along * ray[1, j, 0]
    for k in range(1, WIDTH):
        for j in range(3):
            ray[0, j, k] += along * ray[1, j, k]
        off_face = ray[0, _Y, k] * y + ray[0, _Z, k] * z
        if k == _THETA_2:
            off_face += ray[0, _Z, 0] * y - ray[0, _Y, 0] * z
        for j in range(3):
            ray[0, j, k] -= off_face / leaves * ray[1, j, 0]
    return bool(leaves > 0.0)
