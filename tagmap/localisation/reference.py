"""The methods of the thesis, chapter 4, for comparison: the product does not use them.

Distances from visual angles by Newton's method (eq. 4.3), the position by trilateration (eq. 4.4),
the optical axis from a 3 x 3 system (eq. 4.19). Corrected where the text errs: normalised rays (eq.
4.11) in place of one focal length, and |PL_i| cos(phi_ic) on the right of eq. 4.21 and 4.22.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.errors import DegenerateError

PAIRS = ((0, 1), (0, 2), (1, 2))
_STEPS = 50
_CONVERGED = 1e-12


def visual_angles(rays: Array) -> Array:
    """cos phi (3,) between unit rays (3, 3) of the pairs 01, 02, 12. Eq. 4.2."""
    return np.array([rays[i] @ rays[j] for i, j in PAIRS])


def law_of_cosines(d: Array, cosines: Array, p_map: Array) -> tuple[Array, Array]:
    """Residuals (3,) in m^2 of eq. 4.3 at distances d (3,), and their Jacobian (3, 3)."""
    residual, J = np.empty(3), np.zeros((3, 3))
    for row, ((i, j), c) in enumerate(zip(PAIRS, cosines, strict=True)):
        side = p_map[i] - p_map[j]
        residual[row] = d[i] ** 2 + d[j] ** 2 - 2.0 * c * d[i] * d[j] - side @ side
        J[row, i], J[row, j] = 2.0 * (d[i] - c * d[j]), 2.0 * (d[j] - c * d[i])
    return residual, J


def newton_distances(rays: Array, p_map: Array, start_m: Array) -> Array:
    """Distances (3,) from the optical centre to p_map (3, 3): one of up to four solutions.

    Which one depends on start_m (3,). DegenerateError where Newton's method finds none: on the
    danger cylinder its matrix is singular.
    """
    cosines, d = visual_angles(rays), start_m.astype(np.float64)
    for _ in range(_STEPS):
        residual, J = law_of_cosines(d, cosines, p_map)
        if abs(np.linalg.det(J)) <= 1e-12 * np.abs(J).max() ** 3:
            raise DegenerateError("eq. 4.3 is singular: the camera is on the danger cylinder")
        step = np.linalg.solve(J, residual)
        d = d - step
        if np.abs(step).max() < _CONVERGED * np.abs(d).max():
            if (d > 0.0).all():
                return d
            break
    raise DegenerateError(f"Newton's method on eq. 4.3 does not converge from {start_m} m")


def trilaterate(p_map: Array, d: Array) -> tuple[Array, Array]:
    """Both points (2, 3) at distances d (3,) from three points (3, 3). Eq. 4.4, closed form.

    They are mirror images in the plane of the points; equal where the spheres just miss.
    """
    x = p_map[1] - p_map[0]
    width = np.sqrt(x @ x)
    x = x / width
    across = p_map[2] - p_map[0]
    along = x @ across
    y = across - along * x
    height = np.sqrt(y @ y)
    if not height > 1e-9 * width:
        raise DegenerateError("trilateration from three points on one line: the turn is open")
    y = y / height
    u = (d[0] ** 2 - d[1] ** 2 + width**2) / (2.0 * width)
    v = (d[0] ** 2 - d[2] ** 2 + along**2 + height**2 - 2.0 * along * u) / (2.0 * height)
    w = np.sqrt(max(d[0] ** 2 - u * u - v * v, 0.0))
    foot, normal = p_map[0] + u * x + v * y, np.cross(x, y)
    return foot + w * normal, foot - w * normal


def optical_axis(p_map: Array, p_map_cam: Array, rays: Array) -> Array:
    """Direction (3,) of the optical axis in the map, not of unit length under noise. Eq. 4.19.

    Singular where the camera lies in the plane of the three tags.
    """
    towards = p_map - p_map_cam
    distance = np.sqrt((towards**2).sum(axis=1))
    if abs(np.linalg.det(towards)) <= 1e-9 * distance.prod():
        raise DegenerateError("eq. 4.19 is singular: the camera is in the plane of the tags")
    return np.asarray(np.linalg.solve(towards, distance * rays[:, 2]), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class ThesisPose:
    """p_map_cam (3,), axis (3,) of unit length; the turn about the axis stays open."""

    p_map_cam: Array
    axis: Array


def thesis_pose(rays: Array, p_map: Array, start_m: Array) -> ThesisPose:
    """The whole of chapter 4: rays (3, 3) of any length, p_map (3, 3), distances to start from.

    Of the two mirror images the one whose axis keeps the angles of the rays.
    """
    unit = rays / np.sqrt((rays**2).sum(axis=1, keepdims=True))
    d = newton_distances(unit, p_map, start_m)
    found = []
    for p in trilaterate(p_map, d):
        axis = optical_axis(p_map, p, unit)
        length = np.sqrt(axis @ axis)
        towards = (p_map - p) / d[:, None]
        # A mirror image sees the three tags in the other sense of rotation.
        handed = np.sign(np.linalg.det(towards) * np.linalg.det(unit))
        found.append((handed, ThesisPose(p, axis / length)))
    return max(found, key=lambda one: one[0])[1]
