"""By how much a beam misses a point: the residual of aiming and of calibrating."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.scanner.mirrors import Mirrors, beam


@dataclass(frozen=True, slots=True)
class Miss:
    """Of points (..., 3) in laser beside a beam.

    `off` (..., 2) in m, across the beam: first component about along x of laser, second about
    along z. `ahead` (...) in m, along it. Jacobians of `off`: `by_theta` (..., 2, 2), `by_mirrors`
    (..., 2, 8) by PARAMETERS, `by_point` (..., 2, 3).
    """

    off: Array
    ahead: Array
    by_theta: Array
    by_mirrors: Array
    by_point: Array


def miss(mirrors: Mirrors, theta: Array, p_laser: Array) -> Miss:
    """Mirror angles theta (..., 2), points (..., 3). NaN where there is no beam."""
    ray = beam(mirrors, theta)
    across, spin = _across(ray.direction)
    lever = p_laser - ray.start
    off = (across @ lever[..., None])[..., 0]
    ahead: Array = (lever * ray.direction).sum(axis=-1)
    turned = across @ ray.direction_by
    by = -across @ ray.start_by - ahead[..., None, None] * turned
    # The axes across the beam turn about it when it turns.
    about = (spin[..., None] * turned[..., 1, :])[..., None, :]
    by += np.stack([off[..., 1], -off[..., 0]], axis=-1)[..., None] * about
    return Miss(off, ahead, by[..., :2], by[..., 2:], across)


def _across(n: Array) -> tuple[Array, Array]:
    """Unit axes (..., 2, 3) across directions n (..., 3), the first in the plane of n and x; and
    the angle (...) by which they turn about n per rad of n along the second one."""
    cosine = n[..., 0]
    sine = np.sqrt(n[..., 1] ** 2 + n[..., 2] ** 2)
    first = -cosine[..., None] * n
    first[..., 0] += 1.0
    first /= sine[..., None]
    # first x n, not n x first: beams run along y, so that this one is about z.
    second = np.cross(first, n)
    return np.stack([first, second], axis=-2), -cosine / sine
