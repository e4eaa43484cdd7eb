"""From starts to measured spots: compiled, one after the other."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from robot_agent.perception import gaussian, scan, sift
from robot_agent.perception.compiled import cached, compiled, inlined, internal
from robot_agent.perception.flags import Flag
from robot_agent.perception.scan import peaks, survey
from robot_agent.perception.sift import noise, starts_at
from tagmap.conventions import Array, Index

COLUMNS = 9
"""u, v, cov_uu, cov_uv, cov_uv, cov_vv, flux, variance q, level."""

REACH = 3.3
"""Half a window in sigmas: 0.03 % of what is known of a position lies outside."""

PIXEL_VARIANCE = 1.0 / 12.0
"""What integration over a pixel adds to the variance of a spot."""

SIGNIFICANCE = 6.5
MISFIT_SHARE = 0.03
"""Power of what the model leaves, by that of the spot: lenses are no Gaussians, but nearly."""

_ELONGATION = 0.3
"""(a^2 - b^2) / (a^2 + b^2) of an ellipse with axes 1.36 : 1."""

DOUBT = 5.0
"""Sigmas by which a residual must exceed noise before it means anything."""

_HALF_LEAST, _HALF_MOST = 3, gaussian.WIDEST // 2
_FITS = 4
_SATURATED, _BORDER = int(Flag.SATURATED), int(Flag.BORDER)
_OVERSIZED, _HOT_PIXEL = int(Flag.OVERSIZED), int(Flag.HOT_PIXEL)
_ELONGATED, _MISFIT, _MERGED = int(Flag.ELONGATED), int(Flag.MISFIT), int(Flag.MERGED)
_REFUSED_AT_SIGHT = _HOT_PIXEL | _OVERSIZED
DROPPED = -1
_FEW = 256
_DISORDER_PX = 24.0
"""By which a start may come after a lower one: the height of a band, and half a saturated blob."""


class Sensor(NamedTuple):
    """In grey levels: noise `variance` at level `reference`, `gain` per electron, full scale.

    And the least and the largest sigma of a spot in px.
    """

    variance: float
    reference: float
    gain: float
    full_scale: float
    sigma_least: float
    sigma_most: float


@internal
def crowd(image: Any, sensor: Any, starts: Array, flags: Index) -> None:
    """Mark those MERGED whose windows overlap others; DROPPED those that are the same spot."""
    n = len(flags)
    reach = REACH * np.sqrt(starts[:, 2])
    furthest = 0.0
    for i in range(n):
        furthest = max(furthest, reach[i] + _DISORDER_PX)
    for i in range(n):
        lowest = starts[i, 1] + reach[i] + furthest
        for j in range(i + 1, n):
            if starts[j, 1] > lowest and not flags[j] & _OVERSIZED:
                break
            du, dv = starts[j, 0] - starts[i, 0], starts[j, 1] - starts[i, 1]
            if du * du + dv * dv > (reach[i] + reach[j]) ** 2 or flags[i] < 0 or flags[j] < 0:
                continue
            if (flags[i] | flags[j]) & _REFUSED_AT_SIGHT:
                continue
            if _dips(image, sensor, starts[i], starts[j]):
                flags[i] |= _MERGED
                flags[j] |= _MERGED
            else:
                flags[j] = DROPPED


@compiled
def _dips(image: Any, sensor: Any, a: Array, b: Array) -> bool:
    """Whether it is darker between two peaks than noise alone can explain."""
    first = float(image[round(a[1]), round(a[0])])
    second = float(image[round(b[1]), round(b[0])])
    lesser = min(first, second)
    u, v = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])
    between = float(image[round(v), round(u)])
    return lesser - between > 4.0 * math.sqrt(noise(sensor, lesser))


@internal
def measure(image: Any, sensor: Any, starts: Array, flags: Index) -> Array:
    """Rows of COLUMNS, one for each start (see sift.starts_at). Adds to `flags`.

    What is refused or could not be placed has NaN for a covariance; DROPPED is what was noise, or
    a second start of a spot that another start has found.
    """
    n = len(flags)
    rows = np.full((n, COLUMNS), np.nan)
    work = gaussian.workspace()
    for k in range(n):
        if flags[k] == DROPPED:
            continue
        if flags[k] & (_REFUSED_AT_SIGHT | _MERGED):
            u, v, level = starts[k, 0], starts[k, 1], starts[k, 3]
            rows[k, 0], rows[k, 1], rows[k, 6] = u, v, image[round(v), round(u)] - level
            rows[k, 7], rows[k, 8] = starts[k, 2], level
            continue
        flags[k] = _measure_one(image, sensor, starts[k], flags[k], work, rows[k])
        for j in range(k):
            if flags[j] != DROPPED and flags[k] != DROPPED and not flags[j] & _HOT_PIXEL:
                du, dv = rows[j, 0] - rows[k, 0], rows[j, 1] - rows[k, 1]
                if du * du + dv * dv < 1.0:
                    flags[k] = DROPPED
    return rows


@inlined
def _measure_one(image: Any, sensor: Any, start: Array, flag: int, work: Any, row: Array) -> int:
    """Fill in a row; returns the flags, or DROPPED."""
    height, width = image.shape
    u, v, q = start[0], start[1], start[2]
    variance = noise(sensor, start[3])
    limits = (sensor.sigma_least**2 + PIXEL_VARIANCE, sensor.sigma_most**2 + PIXEL_VARIANCE)
    for _ in range(_FITS):
        half = min(max(math.ceil(REACH * math.sqrt(q) - 0.5), _HALF_LEAST), _HALF_MOST)
        x, y = math.floor(u + 0.5), math.floor(v + 0.5)
        left, right = max(x - half, 0), min(x + half + 1, width)
        top, bottom = max(y - half, 0), min(y + half + 1, height)
        highest, total = load(image, left, top, right, bottom, work.pixels)
        weighted = highest >= sensor.full_scale or sensor.gain > 0.0
        if weighted:
            _mask(work.pixels, right - left, bottom - top, sensor.full_scale)
        spot = gaussian.fit(
            work,
            right - left,
            bottom - top,
            (u - left, v - top, q),
            variance,
            sensor.gain,
            weighted,
            limits,
            total,
        )
        u, v, q = spot.u + left, spot.v + top, spot.q
        outside = not (-0.5 < u < width - 0.5 and -0.5 < v < height - 0.5)
        # Another window is worth its time where this one was too small or beside the spot.
        enough = half + 0.8 > REACH * math.sqrt(q) or half == _HALF_MOST
        if not spot.converged or outside or (enough and abs(u - x) < 1.0 and abs(v - y) < 1.0):
            break
    row[0], row[1], row[6] = u, v, spot.amplitude * 2.0 * math.pi * q
    row[7], row[8] = q, start[3]
    if outside or not spot.converged:
        row[0], row[1] = start[0], start[1]
        return flag | (_OVERSIZED if q == limits[1] else _MISFIT) | (_BORDER if outside else 0)
    if spot.significance < SIGNIFICANCE:
        return DROPPED
    scale = 1.0
    if spot.chi2 - spot.dof > DOUBT * math.sqrt(2.0 * spot.dof):
        # What the model cannot explain is noise as well.
        scale = spot.chi2 / spot.dof
        if spot.chi2 - spot.dof > MISFIT_SHARE * spot.significance**2:
            flag |= _MISFIT
    least = max(_ELONGATION, DOUBT * spot.e_sigma)
    if spot.e1 * spot.e1 + spot.e2 * spot.e2 > least * least:
        flag |= _ELONGATED
    row[2], row[5] = scale * spot.uu, scale * spot.vv
    row[3] = row[4] = scale * spot.uv
    return flag | _cut(u, v, q, width, height)


@inlined
def load(image: Any, left: int, top: int, right: int, bottom: int, pixels: Array) -> Any:
    """Fill the window. Returns its brightest pixel, and the sums of all and of their squares."""
    highest = image[top, left]
    total, square = np.int64(0), np.int64(0)
    for j in range(bottom - top):
        row = image[top + j, left:right]
        for i in range(len(row)):
            value = np.int64(row[i])
            highest = max(highest, row[i])
            total += value
            square += value * value
            pixels[0, j, i] = value
    return highest, (float(total), float(square))


@compiled
def _mask(pixels: Array, nx: int, ny: int, full_scale: float) -> None:
    """What is saturated is left out."""
    for j in range(ny):
        for i in range(nx):
            pixels[1, j, i] = 1.0 if pixels[0, j, i] < full_scale else 0.0


@compiled
def _cut(u: float, v: float, q: float, width: int, height: int) -> int:
    """BORDER where two sigmas of the spot reach out of the image."""
    margin = 2.0 * math.sqrt(q)
    inside = margin - 0.5 < u < width - 0.5 - margin and margin - 0.5 < v < height - 0.5 - margin
    return 0 if inside else _BORDER


def _compiled(sources: tuple[int, ...]) -> Any:
    """The entry. It alone is cached on disk, and the cache looks at no file but this one, so that
    `sources`, a stamp of the others, has to be part of what is compiled.
    """

    @cached
    def spots(
        image: Any,
        threshold: float,
        gain: float,
        full_scale: float,
        sigma_least: float,
        sigma_most: float,
        most: int,
    ) -> tuple[Array, Index, float, float, int, bool]:
        """Rows (k, COLUMNS) and flags (k,), noise variance, background, how many peaks, any merged.

        At most `most` peaks are looked at. All in one compiled function, as calls from Python cost
        as much as a spot.
        """
        _ = sources
        background, variance = survey(image)
        sensor = Sensor(variance, background.mean(), gain, full_scale, sigma_least, sigma_most)
        found = np.empty((_FEW, 2), np.int64)
        n = peaks(image, background, threshold * math.sqrt(variance), found)
        if n > _FEW:
            found = np.empty((most, 2), np.int64)
            n = peaks(image, background, threshold * math.sqrt(variance), found)
        starts, flags = starts_at(image, background, sensor, found[: min(n, most)])
        crowd(image, sensor, starts, flags)
        rows = measure(image, sensor, starts, flags)
        kept, merged = 0, False
        for k in range(len(flags)):
            if flags[k] != DROPPED:
                merged |= flags[k] & _MERGED != 0
                rows[kept], flags[kept] = rows[k], flags[k]
                kept += 1
        return rows[:kept], flags[:kept], variance, sensor.reference, n, merged

    return spots


_SOURCES = (scan, sift, gaussian)
spots = _compiled(tuple(Path(str(module.__file__)).stat().st_mtime_ns for module in _SOURCES))
