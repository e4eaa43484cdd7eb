"""The danger cylinder: where three tags stop determining the pose of a single image.

The right circular cylinder over the circle through three tags. On it the three laws of cosines are
singular: two roots merge, and errors grow without bound (Thompson 1966; thesis 4.2.4: the peaks at
a tilt of asin(r / R)).
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array

_COLLINEAR = 1e-6


@dataclass(frozen=True, slots=True)
class Cylinder:
    """centre (..., 3) and unit axis (..., 3), radius_m (...); NaN for three tags on one line."""

    centre: Array
    axis: Array
    radius_m: Array


def danger_cylinder(p_map: Array) -> Cylinder:
    """Of triples p_map (..., 3, 3)."""
    a, b = p_map[..., 1, :] - p_map[..., 0, :], p_map[..., 2, :] - p_map[..., 0, :]
    normal = np.cross(a, b)
    aa, bb, nn = (a * a).sum(-1), (b * b).sum(-1), (normal * normal).sum(-1)
    flat = nn > (_COLLINEAR * np.maximum(aa, bb)) ** 2
    nn = np.where(flat, nn, np.nan)
    arm = np.cross(normal, aa[..., None] * b - bb[..., None] * a) / (-2.0 * nn[..., None])
    return Cylinder(
        p_map[..., 0, :] + arm, normal / np.sqrt(nn)[..., None], np.sqrt((arm * arm).sum(-1))
    )


def distance_to(cylinder: Cylinder, p: Array) -> Array:
    """Distance (...) in m of points p (..., 3) from the surface, inside or outside."""
    arm = p - cylinder.centre
    along = (arm * cylinder.axis).sum(-1)
    radial = np.sqrt(np.maximum((arm * arm).sum(-1) - along * along, 0.0))
    distance: Array = np.abs(radial - cylinder.radius_m)
    return distance


def distance_m(p_map: Array, p_map_cam: Array) -> float | None:
    """How far the camera at (3,) is from danger with tags (N, 3).

    With more than three tags it is in danger only on the cylinders of all triples at once: the
    largest of their distances. None where no three tags span a plane. All pairs of one tag at a
    time: 256 tags have 2.8 million triples.
    """
    most = -np.inf
    for i in range(len(p_map) - 2):
        each = _distances(p_map[i + 1 :] - p_map[i], p_map_cam - p_map[i])
        most = np.fmax(most, np.fmax.reduce(each, axis=None))
    return float(most) if most >= 0.0 else None


def _distances(p: Array, e: Array) -> Array:
    """(M, M): of the point e (3,) from the cylinders through the origin and every two of p (M, 3).

    `distance_to` of `danger_cylinder`, by r^2 - R^2 = e^2 - 2 e arm - (e n)^2 / n^2.
    """
    square, towards, dot = (p * p).sum(-1), p @ e, p @ p.T
    yz, zx, xy = (np.outer(p[:, i], p[:, j]) for i, j in ((1, 2), (2, 0), (0, 1)))
    nx, ny, nz = yz - yz.T, zx - zx.T, xy - xy.T
    nn, en = nx * nx + ny * ny + nz * nz, e[0] * nx + e[1] * ny + e[2] * nz
    flat = nn > (_COLLINEAR * np.maximum(square[:, None], square)) ** 2
    nn = np.where(flat, nn, np.nan)
    both = np.outer(square, square)
    arm = (both - dot * square) * towards[:, None]
    radius = np.sqrt(both * (square[:, None] + square - 2.0 * dot) / (4.0 * nn))
    power = e @ e - (arm + arm.T + en * en) / nn
    distance: Array = np.abs(power) / (np.sqrt(np.maximum(power + radius**2, 0.0)) + radius)
    return distance
