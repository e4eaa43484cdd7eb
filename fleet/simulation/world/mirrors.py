"""Mirrors: what hangs before one is seen, and lit, behind it as well."""

from dataclasses import dataclass

import numpy as np

from fleet.simulation.scenario.building import Mirror
from fleet.simulation.world.boxes import Boxes
from fleet.simulation.world.sight import Sight
from tagmap.conventions import Array, Index, Mask

DIRECT = -1


@dataclass(frozen=True, slots=True)
class Apparent:
    """Where sources seem to be: p, normal (K, 3), the source (K,) and the mirror (K,) or DIRECT."""

    p: Array
    normal: Array
    source: Index
    mirror: Index

    def only(self, which: Mask | Index) -> "Apparent":
        return Apparent(self.p[which], self.normal[which], self.source[which], self.mirror[which])


@dataclass(frozen=True, slots=True)
class Plane:
    """A mirror: its normal, its axes across and up (3,), its half size, and what it reflects."""

    centre: Array
    normal: Array
    across: Array
    up: Array
    half: tuple[float, float]
    reflects: float

    def behind(self, p: Array) -> Array:
        """Points (K, 3) as they seem in it."""
        return p - 2.0 * ((p - self.centre) @ self.normal)[:, None] * self.normal

    def turned(self, v: Array) -> Array:
        """Directions (K, 3) as they seem in it."""
        return v - 2.0 * (v @ self.normal)[:, None] * self.normal

    def meets(self, origin: Array, image: Array) -> tuple[Array, Mask]:
        """Where lines to images (K, 3) meet it, and whether they do within it, from its front."""
        way = image - origin
        before = float((origin - self.centre) @ self.normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = origin - before / (way @ self.normal)[:, None] * way
            offset = x - self.centre
            inside = (np.abs(offset @ self.across) <= self.half[0]) & (
                np.abs(offset @ self.up) <= self.half[1]
            )
        ahead = (before > 0.0) & ((image - self.centre) @ self.normal < 0.0)
        return x, inside & ahead


def plane(mirror: Mirror) -> Plane:
    angle = np.deg2rad(mirror.heading_deg)
    normal = np.array([np.cos(angle), np.sin(angle), 0.0])
    across = np.array([-normal[1], normal[0], 0.0])
    half = (0.5 * mirror.size_m[0], 0.5 * mirror.size_m[1])
    up = np.array([0.0, 0.0, 1.0])
    return Plane(np.array(mirror.centre_m), normal, across, up, half, mirror.reflects)


def apparent(p: Array, normal: Array, planes: tuple[Plane, ...]) -> Apparent:
    """Sources (N, 3) themselves, then in each mirror."""
    if not planes:
        index = np.arange(len(p))
        return Apparent(p, normal, index, np.full_like(index, DIRECT))
    n = len(p)
    mirror = np.repeat(np.arange(DIRECT, len(planes)), n)
    return Apparent(
        np.concatenate([p, *(plane.behind(p) for plane in planes)]),
        np.concatenate([normal, *(plane.turned(normal) for plane in planes)]),
        np.tile(np.arange(n), 1 + len(planes)),
        mirror,
    )


def shown(
    origin: Array,
    seen: Apparent,
    p: Array,
    planes: tuple[Plane, ...],
    sight: Sight,
    moving: Boxes,
) -> Mask:
    """(K,) whether nothing is between `origin` (3,) and what is seen of sources p (N, 3)."""
    if not planes:
        return sight.free(origin, seen.p, moving)
    ends, legs = seen.p.copy(), np.zeros(len(seen.p), dtype=bool)
    there = np.ones(len(seen.p), dtype=bool)
    for k, plane in enumerate(planes):
        mine = seen.mirror == k
        ends[mine], there[mine] = plane.meets(origin, seen.p[mine])
        legs |= mine
    there[there] = sight.free(origin, ends[there], moving)
    second = there & legs
    there[second] = sight.free(p[seen.source[second]], ends[second], moving)
    return there
