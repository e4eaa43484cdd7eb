"""The most likely Gaussian spot in a window of pixels: compiled.

Model: b + A exp(-((x - u)^2 + (y - v)^2) / (2 q)) at pixel centres. That is a Gaussian of variance
q - 1/12 integrated over pixels, but for a fourth-order term that is below 1e-3 of A once its sigma
exceeds 0.6 px.

Each step solves the normal equations of the five functions

    f = (1, g, (dx^2 + dy^2) g, dx g, dy g),    g = exp(-(dx^2 + dy^2) / (2 q))

whose coefficients are b, A, A dq / (2 q^2), A du / q and A dv / q: Gauss-Newton with the linear
unknowns eliminated. The last two come last, so what elimination leaves in their place is the
information on the position. Without weights all sums separate into rows and columns.

Arrays are few, and numbers returned rather than stored: to pass an array costs as much as to look
at twenty pixels.
"""

from typing import Any, NamedTuple

import numpy as np

from robot_agent.perception.compiled import compiled, inlined, internal
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
    """Room for what a fit needs.

    pixels   window and mask (2, ny, nx); the mask is 1, or 0 for pixels to leave out
    along    functions along x, then those along y (6, n)
    normal   normal matrix (5, 6)
    """

    pixels: Array
    along: Array
    normal: Array


class Shape(NamedTuple):
    """Weighted sums over a window: of its values z, and of what only an elongated spot holds,

    s = (dx^2 - dy^2) g and t = dx dy g. Two letters stand for a product, n for the pixels.
    """

    zs: float
    zt: float
    s: float
    t: float
    gs: float
    gt: float
    ss: float
    tt: float
    zz: float
    n: float


@internal
def workspace() -> Work:
    return Work(np.empty((2, WIDEST, WIDEST)), np.empty((6, WIDEST)), np.empty((5, 6)))


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
    total: tuple[float, float],
) -> Fit:
    """From a start (u, v, q), with q kept within limits.

    total: sum of all pixels, and of their squares. With a gain a pixel has the variance
    `variance` + gain A g; mask and gain count only where `weighted`.
    """
    normal = work.normal
    u, v, q = start
    amplitude = 0.0
    at_limit = 0
    for step in range(_STEPS):
        half = np.exp(-0.5 / q)
        along_x = _along(work.along, 0, nx, u, q, half)
        along_y = _along(work.along, 3, ny, v, q, half)
        if weighted:
            shape = _sum_weighted(work, nx, ny, gain * amplitude / variance)
        else:
            shape = _sum_separable(work, nx, ny, along_x, along_y, total)
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
            e1, e2, e_sigma = _elongation(shape, normal[0, 5], amplitude, per, variance)
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
                (shape.zz - explained) / variance,
                shape.n - 5.0,
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
    shape: Any, level: float, amplitude: float, per: float, variance: float
) -> tuple[float, float, float]:
    stretch = shape.zs - level * shape.s - amplitude * shape.gs
    skew = shape.zt - level * shape.t - amplitude * shape.gt
    sigma = per * np.sqrt(variance * max(4.0 / shape.ss, 1.0 / shape.tt))
    return 2.0 * per * stretch / shape.ss, per * skew / shape.tt, sigma


@inlined
def _along(along: Array, first: int, n: int, centre: float, q: float, half: float) -> Any:
    """Rows g, d g and d^2 g at 0 ... n - 1 around `centre`, from row `first` on, by recurrence.

    half: exp(-1 / (2 q)). Returns their sums, and the sums of g^2 times 1 ... d^4.
    """
    value, ratio, shrink = (
        np.exp(-0.5 * centre * centre / q),
        np.exp(centre / q) * half,
        half * half,
    )
    s0 = s1 = s2 = a0 = a1 = a2 = a3 = a4 = 0.0
    d = -centre
    for i in range(n):
        dg = d * value
        ddg = d * dg
        along[first, i], along[first + 1, i], along[first + 2, i] = value, dg, ddg
        s0 += value
        s1 += dg
        s2 += ddg
        a0 += value * value
        a1 += value * dg
        a2 += dg * dg
        a3 += dg * ddg
        a4 += ddg * ddg
        value *= ratio
        ratio *= shrink
        d += 1.0
    return s0, s1, s2, a0, a1, a2, a3, a4


@inlined
def _sum_separable(
    work: Any, nx: int, ny: int, along_x: Any, along_y: Any, total: tuple[float, float]
) -> Shape:
    """Fill in the normal matrix, all pixels counting alike. along_x, along_y: sums, see _along."""
    s0, s1, s2, a0, a1, a2, a3, a4 = along_x
    t0, t1, t2, b0, b1, b2, b3, b4 = along_y
    d0, dx, dy, dxx, dxy, dyy = _correlate(work.pixels, work.along, nx, ny)
    n = work.normal
    n[0, 0], n[0, 1], n[0, 2] = nx * ny, s0 * t0, s2 * t0 + s0 * t2
    n[0, 3], n[0, 4], n[0, 5] = s1 * t0, s0 * t1, total[0]
    n[1, 1], n[1, 2], n[1, 3] = a0 * b0, a2 * b0 + a0 * b2, a1 * b0
    n[1, 4], n[1, 5] = a0 * b1, d0
    n[2, 2], n[2, 3] = a4 * b0 + 2.0 * a2 * b2 + a0 * b4, a3 * b0 + a1 * b2
    n[2, 4], n[2, 5] = a2 * b1 + a0 * b3, dxx + dyy
    n[3, 3], n[3, 4], n[3, 5] = a2 * b0, a1 * b1, dx
    n[4, 4], n[4, 5] = a0 * b2, dy
    return Shape(
        dxx - dyy,
        dxy,
        s2 * t0 - s0 * t2,
        s1 * t1,
        a2 * b0 - a0 * b2,
        a1 * b1,
        a4 * b0 - 2.0 * a2 * b2 + a0 * b4,
        a2 * b2,
        total[1],
        float(nx * ny),
    )


@inlined
def _correlate(pixels: Array, along: Array, nx: int, ny: int) -> Any:
    """Sums of the window times g, dx g, dy g, dx^2 g, dx dy g, dy^2 g."""
    d0 = dx = dy = dxx = dxy = dyy = 0.0
    for j in range(ny):
        p0 = p1 = p2 = 0.0
        for i in range(nx):
            value = pixels[0, j, i]
            p0 += value * along[0, i]
            p1 += value * along[1, i]
            p2 += value * along[2, i]
        d0 += p0 * along[3, j]
        dx += p1 * along[3, j]
        dy += p0 * along[4, j]
        dxx += p2 * along[3, j]
        dxy += p1 * along[4, j]
        dyy += p0 * along[5, j]
    return d0, dx, dy, dxx, dxy, dyy


@compiled
def _sum_weighted(work: Any, nx: int, ny: int, shot: float) -> Shape:
    """As _sum_separable, a pixel counting by its mask / (1 + shot g)."""
    n, along, pixels = work.normal, work.along, work.pixels
    n[:] = 0.0
    zs = zt = s = t = gs = gt = ss = tt = zz = count = 0.0
    f = np.empty(6)
    for j in range(ny):
        for i in range(nx):
            g = along[0, i] * along[3, j]
            xx, yy = along[2, i] * along[3, j], along[0, i] * along[5, j]
            xy = along[1, i] * along[4, j]
            w = pixels[1, j, i] / (1.0 + shot * g)
            value = pixels[0, j, i]
            f[0], f[1], f[2] = 1.0, g, xx + yy
            f[3], f[4] = along[1, i] * along[3, j], along[0, i] * along[4, j]
            f[5] = value
            for k in range(5):
                for m in range(k, 6):
                    n[k, m] += w * f[k] * f[m]
            zs += w * value * (xx - yy)
            zt += w * value * xy
            s += w * (xx - yy)
            t += w * xy
            gs += w * g * (xx - yy)
            gt += w * g * xy
            ss += w * (xx - yy) ** 2
            tt += w * xy * xy
            zz += w * value * value
            count += pixels[1, j, i]
    return Shape(zs, zt, s, t, gs, gt, ss, tt, zz, count)


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
