"""By how much a beam misses a point: the residual of aiming and of calibrating."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.rows import rows
from tagmap.geometry.scanner.mirrors import Mirrors


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
    from tagmap.geometry.kernels import pointing

    shape, theta, p_laser = paired(theta, p_laser)
    off, ahead = np.empty((*shape, 2)), np.empty(shape)
    by, across = np.empty((*shape, 2, 10)), np.empty((*shape, 2, 3))
    pointing.misses(
        mirrors.values,
        theta,
        p_laser,
        off.reshape(-1, 2),
        ahead.reshape(-1),
        by.reshape(-1, 2, 10),
        across.reshape(-1, 2, 3),
    )
    return Miss(off, ahead, by[..., :2], by[..., 2:], across)


def paired(theta: Array, p: Array) -> tuple[tuple[int, ...], Array, Array]:
    """Angles (..., 2) and points (..., 3) broadcast: their shape, and both as rows."""
    shape = theta.shape[:-1]
    if p.shape[:-1] != shape:
        shape = np.broadcast_shapes(shape, p.shape[:-1])
        # Copied: for rows that cannot be written to kernels would be compiled once more.
        theta = np.array(np.broadcast_to(theta, (*shape, 2)), order="C")
        p = np.array(np.broadcast_to(p, (*shape, 3)), order="C")
    return shape, rows(theta), rows(p)
