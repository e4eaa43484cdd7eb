"""Beams beside points, compiled: where tagmap.geometry.scanner is computed."""

import math

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.mirrors import WIDTH, beam

_STEPS = 20
_CONVERGED_RAD = 1e-13
_RELATIVE_MISS = 1e-12
_LARGEST_STEP_RAD = 0.2


@compiled
def miss(
    mirrors: Array, theta: Array, p: Array, ray: Array, off: Array, by: Array, across: Array
) -> float:
    """Of a point p (3,) at angles (2,): how far ahead it is; off (2,), by (2, 10) and across (2, 3)
    as in tagmap.geometry.scanner.miss. `ray` (2, 3, 11) takes the beam."""
    beam(mirrors, theta[0], theta[1], ray)
    nx, ny, nz = ray[1, 0, 0], ray[1, 1, 0], ray[1, 2, 0]
    sine = math.sqrt(ny * ny + nz * nz)
    across[0, 0], across[0, 1], across[0, 2] = sine, -nx * ny / sine, -nx * nz / sine
    across[1, 0], across[1, 1], across[1, 2] = 0.0 * sine, -nz / sine, ny / sine
    u, v, w = p[0] - ray[0, 0, 0], p[1] - ray[0, 1, 0], p[2] - ray[0, 2, 0]
    ahead: float = u * nx + v * ny + w * nz
    for a in range(2):
        off[a] = across[a, 0] * u + across[a, 1] * v + across[a, 2] * w
        for k in range(1, WIDTH):
            s = 0.0
            for j in range(3):
                s -= across[a, j] * (ray[0, j, k] + ahead * ray[1, j, k])
            by[a, k - 1] = s
    for k in range(1, WIDTH):
        # The axes across the beam turn about it when it turns.
        turned = across[1, 1] * ray[1, 1, k] + across[1, 2] * ray[1, 2, k]
        about = -nx / sine * turned
        by[0, k - 1] += off[1] * about
        by[1, k - 1] -= off[0] * about
    return ahead


@compiled
def misses(
    mirrors: Array, theta: Array, p: Array, off: Array, ahead: Array, by: Array, across: Array
) -> None:
    """Of points (N, 3) at angles (N, 2)."""
    ray = np.empty((2, 3, WIDTH))
    for i in range(len(p)):
        ahead[i] = miss(mirrors, theta[i], p[i], ray, off[i], by[i], across[i])


@compiled
def angles(mirrors: Array, p: Array, theta: Array) -> None:
    """theta (N, 2) whose beams pass through points (N, 3); NaN where no beam goes."""
    ray, off, by, across = np.empty((2, 3, WIDTH)), np.empty(2), np.empty((2, 10)), np.empty((2, 3))
    for i in range(len(p)):
        _start(mirrors, p[i], theta[i])
        for _ in range(_STEPS):
            miss(mirrors, theta[i], p[i], ray, off, by, across)
            determinant = by[0, 0] * by[1, 1] - by[0, 1] * by[1, 0]
            step_1 = (by[1, 1] * off[0] - by[0, 1] * off[1]) / determinant
            step_2 = (by[0, 0] * off[1] - by[1, 0] * off[0]) / determinant
            theta[i, 0] -= min(max(step_1, -_LARGEST_STEP_RAD), _LARGEST_STEP_RAD)
            theta[i, 1] -= min(max(step_2, -_LARGEST_STEP_RAD), _LARGEST_STEP_RAD)
            if not (abs(step_1) > _CONVERGED_RAD or abs(step_2) > _CONVERGED_RAD):
                break
        ahead = miss(mirrors, theta[i], p[i], ray, off, by, across)
        hits = off[0] * off[0] + off[1] * off[1] <= (_RELATIVE_MISS * (1.0 + ahead)) ** 2
        if not (ahead > 0.0 and hits):
            theta[i, 0] = theta[i, 1] = math.nan


@compiled
def _start(mirrors: Array, p: Array, theta: Array) -> None:
    """Exact for the simplified model: thesis, eq. 3.10."""
    far = math.sqrt(p[1] * p[1] + p[2] * p[2]) + mirrors[0]
    quarter = 0.25 * math.pi
    theta[0] = -0.5 * math.atan2(p[0], far) + mirrors[2] - quarter + 0.5 * mirrors[7]
    theta[1] = 0.5 * math.atan2(p[2], p[1]) + mirrors[3] - quarter


@compiled
def points(
    mirrors: Array,
    T: Array,
    free: Index,
    theta: Array,
    p_cam: Array,
    off: Array,
    ahead: Array,
    by_theta: Array,
    by_point: Array,
    by_scanner: Array,
) -> None:
    """Of points (N, 3) in cam; T (4, 4): cam from laser. free: columns of PARAMETERS."""
    ray, by, across, p = np.empty((2, 3, WIDTH)), np.empty((2, 10)), np.empty((2, 3)), np.empty(3)
    for i in range(len(p_cam)):
        for j in range(3):
            p[j] = 0.0
            for k in range(3):
                p[j] += T[k, j] * (p_cam[i, k] - T[k, 3])
        ahead[i] = miss(mirrors, theta[i], p, ray, off[i], by, across)
        for a in range(2):
            by_theta[i, a, 0], by_theta[i, a, 1] = by[a, 0], by[a, 1]
            x, y, z = across[a, 0], across[a, 1], across[a, 2]
            for k in range(3):
                by_point[i, a, k] = x * T[k, 0] + y * T[k, 1] + z * T[k, 2]
                # p_laser = (T_cam_laser exp(delta))^-1 p_cam
                by_scanner[i, a, k] = -across[a, k]
            by_scanner[i, a, 3] = y * p[2] - z * p[1]
            by_scanner[i, a, 4] = z * p[0] - x * p[2]
            by_scanner[i, a, 5] = x * p[1] - y * p[0]
            for k in range(len(free)):
                by_scanner[i, a, 6 + k] = by[a, 2 + free[k]]
