"""Ceilings full of tags, and the unlabelled spots that a robot with a wide rig sees of them."""

from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeAlias

import numpy as np

from fleet.simulation.views import WIDE_RIG
from tagmap.conventions import Array, Index, Mask
from tagmap.errors import DataError
from tagmap.geometry import se3, so3, stereo
from tagmap.localisation.constellation.expectation import Frame

Pattern: TypeAlias = Literal["random", "grid"]

NEAR_M, FAR_M = 3.0, 6.0
HEIGHT_M = 5.0
_APART_M = 0.3
_HANGING_M = 0.3
_TILT_RAD = 0.1
_DETECTION = 0.9
_SEEN_M2 = 27.0
_ENOUGH = 10_000


@dataclass(frozen=True, slots=True)
class Ceiling:
    """True p_map (M, 3), and what the map says of it: p_known (M, 3), each +- sigma_m."""

    p_map: Array
    p_known: Array
    sigma_m: float

    def tags(self) -> dict[str, tuple[Array, Array]]:
        cov = self.sigma_m**2 * np.eye(3)
        return {f"t{i}": (p, cov) for i, p in enumerate(self.p_known)}


@dataclass(frozen=True, slots=True)
class Spots:
    """p_cam (N, 3) with cov (N, 3, 3), shuffled; tag (N,) that each one is, -1 for foreign ones."""

    p_cam: Array
    cov: Array
    tag: Index
    T_map_cam: Array


def ceiling(
    rng: np.random.Generator,
    pattern: Pattern,
    count: int,
    pitch_m: float,
    jitter_m: float = 0.05,
    sigma_m: float = 0.003,
) -> Ceiling:
    """`count` tags, one in pitch_m^2.

    random  anywhere, no nearer to each other than 0.3 m, hanging 0 to 30 cm
    grid    flat; each off its place by a normal error of `jitter_m` in x and in y
    """
    side = int(np.ceil(np.sqrt(count)))
    if pattern == "grid":
        cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)[:count]
        xy = pitch_m * cells + jitter_m * rng.standard_normal((count, 2))
        hanging = np.zeros(count)
    else:
        xy = _scattered(rng, count, pitch_m * np.sqrt(count))
        hanging = rng.uniform(0.0, _HANGING_M, count)
    p_map = np.column_stack([xy, HEIGHT_M - hanging])
    return Ceiling(p_map, p_map + sigma_m * rng.standard_normal((count, 3)), sigma_m)


def _scattered(rng: np.random.Generator, count: int, side_m: float) -> Array:
    xy = np.zeros((0, 2))
    while len(xy) < count:
        new = rng.uniform(0.0, side_m, 2)
        if not len(xy) or ((xy - new) ** 2).sum(-1).min() > _APART_M**2:
            xy = np.vstack([xy, new])
    return xy


def look_up(
    rng: np.random.Generator, above: Ceiling, n: int, foreign: int, sigma_px: float | None = None
) -> Spots:
    """`n` tags and `foreign` lamps from a random place below that shows so many.

    The camera looks up within 0.1 rad, turned anyhow. Of the tags in both images and 3 to 6 m away
    one in ten gives no spot. Lamps hang among the tags, no nearer to one than 0.3 m.
    """
    for _ in range(_ENOUGH):
        T_map_cam = _below(rng, above)
        seen = np.flatnonzero(_visible(T_map_cam, above.p_map))
        tag = seen[rng.random(len(seen)) < _DETECTION]
        if len(tag) == n:
            lamps = _lamps(rng, T_map_cam, above, foreign)
            p_map = np.vstack([above.p_map[tag], lamps])
            return _measured(rng, T_map_cam, p_map, np.append(tag, np.full(foreign, -1)), sigma_px)
    raise DataError(f"no place of {_ENOUGH} shows {n} tags: choose another pitch")


def pitch_for(n: int) -> float:
    """Distance between tags, m, at which `n` of them are seen at a time, as a rule."""
    return float(np.sqrt(_SEEN_M2 / n))


def frame() -> Frame:
    return _frame()


@cache
def _frame() -> Frame:
    return Frame.of(WIDE_RIG, NEAR_M, FAR_M)


def _below(rng: np.random.Generator, above: Ceiling) -> Array:
    low, high = above.p_map[:, :2].min(0), above.p_map[:, :2].max(0)
    p = np.append(rng.uniform(low, high), HEIGHT_M - rng.uniform(NEAR_M + 0.3, 5.0))
    turn, tilt = rng.uniform(-np.pi, np.pi), rng.uniform(-_TILT_RAD, _TILT_RAD, 2)
    R = so3.exp(np.array([0.0, 0.0, turn])) @ so3.exp(np.array([*tilt, 0.0]))
    return se3.from_p_R(p, R)


def _visible(T_map_cam: Array, p_map: Array) -> Mask:
    p_cam = se3.act(se3.inverse(T_map_cam), p_map)
    x, y, z = frame().x, frame().y, p_cam[:, 2]
    inside = (p_cam[:, 0] > x[0] * z) & (p_cam[:, 0] < x[1] * z)
    inside &= (p_cam[:, 1] > y[0] * z) & (p_cam[:, 1] < y[1] * z)
    return np.asarray(inside & (z > NEAR_M) & (z < FAR_M))


def _lamps(rng: np.random.Generator, T_map_cam: Array, above: Ceiling, count: int) -> Array:
    lamps = np.zeros((0, 3))
    while len(lamps) < count:
        new = T_map_cam[:3, 3] + [*rng.uniform(-FAR_M, FAR_M, 2), 0.0]
        new[2] = HEIGHT_M - rng.uniform(0.0, _HANGING_M)
        away = ((above.p_map - new) ** 2).sum(-1).min() > _APART_M**2
        if away and _visible(T_map_cam, new[None])[0]:
            lamps = np.vstack([lamps, new])
    return lamps


def _measured(
    rng: np.random.Generator,
    T_map_cam: Array,
    p_map: Array,
    tag: Index,
    sigma_px: float | None,
) -> Spots:
    shuffled = rng.permutation(len(tag))
    px, _ = stereo.project(WIDE_RIG, se3.act(se3.inverse(T_map_cam), p_map[shuffled]))
    sigma = WIDE_RIG.sigma_px if sigma_px is None else sigma_px
    px = px + sigma * rng.standard_normal(px.shape)
    p_cam, cov, _ = stereo.triangulate(
        WIDE_RIG, px, np.broadcast_to(sigma**2 * np.eye(4), (len(tag), 4, 4))
    )
    return Spots(p_cam, cov, tag[shuffled], T_map_cam)
