"""Where a search begins: tags triangulated from two images, and triples of rays."""

import math
from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled, internal
from tagmap.localisation.kernels.inlined import inlined
from tagmap.localisation.kernels.motion import Pose
from tagmap.localisation.kernels.p3p import Triangle, frame, place
from tagmap.localisation.kernels.sightings import CROSS, LEFT, RAY, RIGHT
from tagmap.localisation.kernels.view import View

NOWHERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Stage(NamedTuple):
    """Of each tag: unit ray in cam (N, 3), and measured (N, 4): distance along it, its sigma, the
    sigma of the ray's direction, and 1; zero where not both images see it. m and rad."""

    ray: Array
    measured: Array


@compiled
def new_stage(n: int) -> Stage:
    return Stage(np.zeros((n, 3)), np.zeros((n, 4)))


@inlined
def triangulate(view: View, stage: Stage) -> int:
    """Fill the stage; how many tags were triangulated, where the rays of both images come closest.

    Where only the right camera sees a tag its ray counts as one of the left: good enough to start
    from.
    """
    rows, M = view.rows, view.rig
    ray, measured = stage.ray, stage.measured
    found = 0
    for i in range(view.n):
        left, right = rows[i, LEFT] > 0.0, rows[i, RIGHT] > 0.0
        u, v = rows[i, RAY + 2], rows[i, RAY + 3]
        if left:
            x, y, z = rows[i, RAY], rows[i, RAY + 1], 1.0
        else:
            x = M[0] * u + M[4] * v + M[8]
            y = M[1] * u + M[5] * v + M[9]
            z = M[2] * u + M[6] * v + M[10]
        length = math.sqrt(x * x + y * y + z * z)
        inverse = 1.0 / length
        ray[i, 0], ray[i, 1], ray[i, 2] = x * inverse, y * inverse, z * inverse
        for k in range(4):
            measured[i, k] = 0.0
        if not (left and right):
            continue
        a = M[0] * x + M[1] * y + M[2]
        b = M[4] * x + M[5] * y + M[6]
        c = M[8] * x + M[9] * y + M[10]
        aa, rr, ar = a * a + b * b + c * c, u * u + v * v + 1.0, a * u + b * v + c
        at = a * M[3] + b * M[7] + c * M[11]
        rt = u * M[3] + v * M[7] + M[11]
        depth = (ar * rt - rr * at) / (aa * rr - ar * ar)
        if not (depth > 0.0 and depth < math.inf):
            continue
        t = 1.0 / (c * depth + M[11])
        e, f = t * (a - u * c), t * (b - v * c)
        by_left = e * e * rows[i, LEFT] + f * f * rows[i, LEFT + 2]
        by_left += 2.0 * e * f * rows[i, LEFT + 1]
        by_right = e * e * rows[i, RIGHT] + f * f * rows[i, RIGHT + 2]
        by_right += 2.0 * e * f * rows[i, RIGHT + 1]
        measured[i, 0] = depth * length
        measured[i, 1] = length * math.sqrt(1.0 / by_left + 1.0 / by_right)
        for k in range(4):
            # Errors that the images share may add up: no depth is promised then.
            if rows[i, CROSS + k] != 0.0:
                measured[i, 1] = math.inf
        measured[i, 2] = math.sqrt(2.0 / (rows[i, LEFT] + rows[i, LEFT + 2]))
        measured[i, 3] = 1.0
        found += 1
    return found


@inlined
def from_depths(view: View, stage: Stage) -> tuple[bool, Pose]:
    """The pose that lays a wide triple of triangulated tags on their places; False without one."""
    i, j, k = widest(view, stage, -1, 1.0)
    if k < 0:
        return False, NOWHERE
    rays, p = triangle(stage.ray, i, j, k), triangle(view.rows, i, j, k)
    x, y, z = stage.measured[i, 0], stage.measured[j, 0], stage.measured[k, 0]
    return True, place(rays, p, frame(p[0], p[1], p[2]), x, y, z)


@inlined
def widest(view: View, stage: Stage, skip: int, least: float) -> tuple[int, int, int]:
    """Three tags, as far apart as a greedy choice finds; the last is -1 if there are none. Without
    tag `skip`, and least = 1: of triangulated tags only, 0: of all."""
    ray = stage.ray
    first = 0
    while first < view.n and (first == skip or stage.measured[first, 3] < least):
        first += 1
    if first == view.n:
        return 0, 0, -1
    second = _furthest(view.n, stage, first, skip, least)
    first = _furthest(view.n, stage, second, skip, least)
    third, most = -1, 0.0
    for i in range(view.n):
        if i != first and i != second and i != skip and stage.measured[i, 3] >= least:
            volume = _area(ray, first, second, i) * _area(view.rows, first, second, i)
            if volume > most:
                most, third = volume, i
    return first, second, third


@internal
def triangle(a: Array, i: int, j: int, k: int) -> Triangle:
    """The first three columns of three rows."""
    return (
        (a[i, 0], a[i, 1], a[i, 2]),
        (a[j, 0], a[j, 1], a[j, 2]),
        (a[k, 0], a[k, 1], a[k, 2]),
    )


@inlined
def _furthest(n: int, stage: Stage, base: int, skip: int, least: float) -> int:
    ray = stage.ray
    other, narrowest = base, 2.0
    for i in range(n):
        if i != base and i != skip and stage.measured[i, 3] >= least:
            cosine = ray[i, 0] * ray[base, 0] + ray[i, 1] * ray[base, 1] + ray[i, 2] * ray[base, 2]
            if cosine < narrowest:
                other, narrowest = i, cosine
    return other


@compiled
def _area(p: Array, i: int, j: int, k: int) -> float:
    """Squared area, times four."""
    x, y, z = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
    u, v, w = p[k, 0] - p[i, 0], p[k, 1] - p[i, 1], p[k, 2] - p[i, 2]
    a, b, c = y * w - z * v, z * u - x * w, x * v - y * u
    area: float = a * a + b * b + c * c
    return area
