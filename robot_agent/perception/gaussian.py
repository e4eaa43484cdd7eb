"""The most likely Gaussian spot in a window of pixels: compiled.

Model: b + A exp(-((x - u)^2 + (y - v)^2) / (2 q)) at pixel centres. That is a Gaussian of variance
q - 1/12 integrated over pixels, but for a fourth-order term that is below 1e-3 of A once its sigma
exceeds 0.6 px.

Each step solves the normal equations of the five functions

    f = (1, g, (dx^2 + dy^2) g, dx g, dy g),    g = exp(-(dx^2 + dy^2) / (2 q))

whose coefficients are b, A, A dq / (2 q^2), A du / q and A dv / q: Gauss-Newton with the linear
unknowns eliminated. The last two come last, so what elimination leaves in their place is the
information on the position. Without weights all sums separate into rows and columns.
"""

from typing import Any, NamedTuple

import numpy as np

from robot_agent.perception.compiled import compiled, inlined
from tagmap.conventions import Array

WIDEST = 31
"""Pixels of the largest window's side."""

_STEPS = 12
_REMAINDER = 0.02
_LONGEST_STEP_PX = 1.0


class Fit(NamedTuple):
    """A fitted spot in window coordinates, px and grey levels.

    uu, uv, vv    covariance of (u, v)
    significance  of A, in sigmas
    chi2, dof     of the residuals
    e1, e2        (qx - qy) / (qx + qy) and 2 qxy / (qx + qy), how elongated, to first order
    e_sigma       the larger sigma of the two
    """

    converged: bool
    u: float
    v: float
    q: float
    amplitude: float
    level: float
    uu: float
    uv: float
    vv: float
    significance: float
    chi2: float
    dof: float
    e1: float
    e2: float
    e_sigma: float


class Work(NamedTuple):
    """Window and mask (ny, nx), functions along x and y, normal matrix, shape sums,
    and the sums of all pixels and of their squares.

    The mask is 1, or 0 for pixels to leave out.
    """

    window: Array
    mask: Array
    along_x: Array
    along_y: Array
    normal: Array
    shape: Array
    sums: Array


@compiled
def workspace() -> Work:
    room = (WIDEST, WIDEST)
    return Work(
        np.empty(room),
        np.empty(room),
        np.empty((3, WIDEST)),
        np.empty((3, WIDEST)),
        np.empty((5, 6)),
        np.empty(10),
        np.empty(2),
    )


@inlined
def fit(
    work: Any,
    nx: int,
    ny: int,
    start: tuple[float, float, float],
    variance: float,
    gain: float,
    weighted: bool,
    limits: tuple[float, float],
) -> Fit:
    """From a start (u, v, q), with q kept within limits.

    With a gain a pixel has the variance `variance` + gain A g; mask and gain count only where
    `weighted`.
    """
    normal = work.normal
    u, v, q = start
    amplitude = 0.0
    at_limit = 0
    for step in range(_STEPS):
        _exponentials(work.along_x, nx, u, q)
        _exponentials(work.along_y, ny, v, q)
        if weighted:
            _sum_weighted(work, nx, ny, gain * amplitude / variance)
        else:
            _sum_separable(work, nx, ny)
        power = normal[1, 1]
        explained, gained, uu, uv, vv = _solve(normal)
        amplitude = normal[1, 5]
        if not (explained > 0.0 and amplitude > 0.0):
            break
        per = q / amplitude
        significance = amplitude * np.sqrt(power / variance)
        # What a step of n sigmas leaves undone is about n^2 / significance sigmas.
        if gained < _REMAINDER * significance * variance and (step > 0 or gain == 0.0):
            scale = variance * per * per / (uu * vv - uv * uv)
            e1, e2, e_sigma = _elongation(work.shape, normal[0, 5], amplitude, per, variance)
            return Fit(
                True,
                u + per * normal[3, 5],
                v + per * normal[4, 5],
                _kept(q * (1.0 + 2.0 * per * normal[2, 5]), limits),
                amplitude,
                normal[0, 5],
                vv * scale,
                -uv * scale,
                uu * scale,
                significance,
                (work.shape[8] - explained) / variance,
                work.shape[9] - 5.0,
                e1,
                e2,
                e_sigma,
            )
        du, dv = per * normal[3, 5], per * normal[4, 5]
        longest = max(abs(du), abs(dv), _LONGEST_STEP_PX)
        u, v = u + du / longest, v + dv / longest
        q = _kept(q * min(max(1.0 + 2.0 * per * normal[2, 5], 0.5), 2.0), limits)
        at_limit = at_limit + 1 if q == limits[0] or q == limits[1] else 0
        if at_limit > 2 or not (-1.0 < u < nx and -1.0 < v < ny):
            break
    lost = np.nan
    return Fit(
        False, u, v, q, amplitude, lost, lost, lost, lost, lost, lost, lost, lost, lost, lost
    )


@compiled
def _kept(q: float, limits: tuple[float, float]) -> float:
    return min(max(q, limits[0]), limits[1])


@compiled
def _elongation(
    shape: Array, level: float, amplitude: float, per: float, variance: float
) -> tuple[float, float, float]:
    stretch = shape[0] - level * shape[2] - amplitude * shape[4]
    skew = shape[1] - level * shape[3] - amplitude * shape[5]
    sigma = per * np.sqrt(variance * max(4.0 / shape[6], 1.0 / shape[7]))
    return 2.0 * per * stretch / shape[6], per * skew / shape[7], sigma


@inlined
def _exponentials(along: Array, n: int, centre: float, q: float) -> None:
    """g, d g and d^2 g at 0 ... n - 1 around `centre`, by recurrence."""
    d = -centre
    value = np.exp(-0.5 * d * d / q)
    ratio = np.exp(-(d + 0.5) / q)
    shrink = np.exp(-1.0 / q)
    for i in range(n):
        along[0, i] = value
        along[1, i] = d * value
        along[2, i] = d * d * value
        value *= ratio
        ratio *= shrink
        d += 1.0


@inlined
def _sum_separable(work: Any, nx: int, ny: int) -> None:
    """Fill in normal matrix and shape sums, all pixels counting alike."""
    s0, s1, s2, a0, a1, a2, a3, a4 = _moments(work.along_x, nx)
    t0, t1, t2, b0, b1, b2, b3, b4 = _moments(work.along_y, ny)
    along_x, along_y, window = work.along_x, work.along_y, work.window
    d0 = dx = dy = dxx = dxy = dyy = 0.0
    for j in range(ny):
        p0 = p1 = p2 = 0.0
        for i in range(nx):
            value = window[j, i]
            p0 += value * along_x[0, i]
            p1 += value * along_x[1, i]
            p2 += value * along_x[2, i]
        d0 += p0 * along_y[0, j]
        dx += p1 * along_y[0, j]
        dy += p0 * along_y[1, j]
        dxx += p2 * along_y[0, j]
        dxy += p1 * along_y[1, j]
        dyy += p0 * along_y[2, j]
    n = work.normal
    n[0, 0], n[0, 1], n[0, 2] = nx * ny, s0 * t0, s2 * t0 + s0 * t2
    n[0, 3], n[0, 4], n[0, 5] = s1 * t0, s0 * t1, work.sums[0]
    n[1, 1], n[1, 2], n[1, 3] = a0 * b0, a2 * b0 + a0 * b2, a1 * b0
    n[1, 4], n[1, 5] = a0 * b1, d0
    n[2, 2], n[2, 3] = a4 * b0 + 2.0 * a2 * b2 + a0 * b4, a3 * b0 + a1 * b2
    n[2, 4], n[2, 5] = a2 * b1 + a0 * b3, dxx + dyy
    n[3, 3], n[3, 4], n[3, 5] = a2 * b0, a1 * b1, dx
    n[4, 4], n[4, 5] = a0 * b2, dy
    shape = work.shape
    shape[0], shape[1] = dxx - dyy, dxy
    shape[2], shape[3] = s2 * t0 - s0 * t2, s1 * t1
    shape[4], shape[5] = a2 * b0 - a0 * b2, a1 * b1
    shape[6], shape[7] = a4 * b0 - 2.0 * a2 * b2 + a0 * b4, a2 * b2
    shape[8], shape[9] = work.sums[1], nx * ny


@inlined
def _moments(along: Array, n: int) -> Any:
    """Sums of g, d g, d^2 g, and of g^2 times 1 ... d^4."""
    s0 = s1 = s2 = a0 = a1 = a2 = a3 = a4 = 0.0
    for i in range(n):
        g, dg, ddg = along[0, i], along[1, i], along[2, i]
        s0 += g
        s1 += dg
        s2 += ddg
        a0 += g * g
        a1 += g * dg
        a2 += dg * dg
        a3 += dg * ddg
        a4 += ddg * ddg
    return s0, s1, s2, a0, a1, a2, a3, a4


@compiled
def _sum_weighted(work: Any, nx: int, ny: int, shot: float) -> None:
    """As _sum_separable, a pixel counting by its mask / (1 + shot g)."""
    n, shape, along_x, along_y = work.normal, work.shape, work.along_x, work.along_y
    n[:] = 0.0
    shape[:] = 0.0
    f = np.empty(6)
    for j in range(ny):
        for i in range(nx):
            g = along_x[0, i] * along_y[0, j]
            xx = along_x[2, i] * along_y[0, j]
            yy = along_x[0, i] * along_y[2, j]
            xy = along_x[1, i] * along_y[1, j]
            w = work.mask[j, i] / (1.0 + shot * g)
            value = work.window[j, i]
            f[0], f[1], f[2] = 1.0, g, xx + yy
            f[3], f[4] = along_x[1, i] * along_y[0, j], along_x[0, i] * along_y[1, j]
            f[5] = value
            for k in range(5):
                for m in range(k, 6):
                    n[k, m] += w * f[k] * f[m]
            shape[0] += w * value * (xx - yy)
            shape[1] += w * value * xy
            shape[2] += w * (xx - yy)
            shape[3] += w * xy
            shape[4] += w * g * (xx - yy)
            shape[5] += w * g * xy
            shape[6] += w * (xx - yy) ** 2
            shape[7] += w * xy * xy
            shape[8] += w * value * value
            shape[9] += work.mask[j, i]


@inlined
def _solve(normal: Array) -> tuple[float, float, float, float, float]:
    """Coefficients into column 5. Returns what all five explain of the data's sum of squares, what
    the last three do, and the information (uu, uv, vv) on the last two; 0 where it is singular.
    """
    explained = gained = uu = uv = vv = 0.0
    for k in range(5):
        pivot = normal[k, k]
        if not pivot > 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0
        if k == 3:
            uu, uv, vv = pivot, normal[3, 4], normal[4, 4]
        part = normal[k, 5] * normal[k, 5] / pivot
        explained += part
        if k >= 2:
            gained += part
        for i in range(k + 1, 5):
            factor = normal[k, i] / pivot
            for j in range(i, 6):
                normal[i, j] -= factor * normal[k, j]
    for k in range(4, -1, -1):
        total = normal[k, 5]
        for j in range(k + 1, 5):
            total -= normal[k, j] * normal[j, 5]
        normal[k, 5] = total / normal[k, k]
    return explained, gained, uu, uv, vv
