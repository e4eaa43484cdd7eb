"""Where to next: along given points, or through free space at random, where it has not been yet."""

from dataclasses import dataclass, field

import numpy as np

from fleet.simulation.scenario.fields import Point2
from fleet.simulation.scenario.robot import Route
from fleet.simulation.world.boxes import Boxes
from fleet.simulation.world.sight import Sight
from tagmap.conventions import Array, Mask
from tagmap.errors import ConfigError

EVERY_M = 0.15
"""Distance of the places at which a way is checked."""
SPARE_M = 0.10
DRAWS = 400
CHOICES = 12
LEGS_M = (1.5, 10.0)


@dataclass(frozen=True, slots=True)
class Space:
    """Where a robot of this radius and height fits; `solid` has no room inside."""

    sight: Sight
    solid: Boxes
    radius_m: float
    height_m: float

    def fits(self, at: Array) -> Mask:
        """(K,) at places (K, 2): inside, under a ceiling high enough, and clear."""
        n, low = len(at), self.radius_m + 0.01
        eye = np.column_stack([at, np.full(n, low)])
        up, _ = self.sight.first(eye, np.tile([0.0, 0.0, 1.0], (n, 1)))
        down, _ = self.sight.first(eye, np.tile([0.0, 0.0, -1.0], (n, 1)))
        lid = eye + np.array([0.0, 0.0, self.height_m])
        inside: Mask = (
            ~self.solid.block(eye, lid)
            & np.isfinite(up)
            & np.isfinite(down)
            & (up > self.height_m - low)
        )
        return inside & self.is_clear(at)

    def fits_along(self, here: Array, there: Array) -> bool:
        """All the way, in a straight line between places (2,) of which it fits at the first."""
        n = 2 + int(np.linalg.norm(there - here) / EVERY_M)
        way = here + np.linspace(0.0, 1.0, n)[:, None] * (there - here)
        return bool(self.is_clear(way).all() and self.fits(there[None])[0])

    def is_clear(self, at: Array) -> Mask:
        """(K,) whether nothing is nearer than the radius, at two heights."""
        low, clear = self.radius_m + 0.01, np.ones(len(at), dtype=bool)
        for height in (low, max(low, self.height_m - self.radius_m)):
            p = np.column_stack([at, np.full(len(at), height)])
            clear &= self.sight.clearance(p) > self.radius_m
        return clear


@dataclass(slots=True)
class Waypoints:
    """Over and over: from the last on to the first, or back the way it came."""

    points: tuple[Point2, ...]
    loop: bool
    space: Space
    name: str
    _number: int = 0

    def next(self, here: Point2) -> Point2:
        n = len(self.points)
        self._number += 1
        k = self._number % (n if self.loop else max(1, 2 * n - 2))
        there = self.points[k if k < n else 2 * n - 2 - k]
        if not self.space.fits_along(np.array(here), np.array(there)):
            raise ConfigError(
                f"robot {self.name}: it does not fit between {_shown(here)} and"
                f" {_shown(there)} m, expected {self.space.radius_m:.2f} m free on either side"
            )
        return there


@dataclass(slots=True)
class Tour:
    """Of a few places that can be reached straight away, the one farthest from where it was."""

    route: Route
    space: Space
    rng: np.random.Generator
    name: str
    _been: list[Array] = field(default_factory=list)

    def start(self) -> Point2:
        for at in self._draw():
            return self._go(at)
        raise ConfigError(f"robot {self.name}: no free place found for it to start from")

    def next(self, here: Point2) -> Point2:
        found: list[Array] = []
        for at in self._draw():
            far = np.hypot(*(at - here))
            if LEGS_M[0] <= far <= LEGS_M[1] and self.space.fits_along(np.array(here), at):
                found.append(at)
            if len(found) == CHOICES:
                break
        if not found:
            raise ConfigError(f"robot {self.name}: it cannot get away from {_shown(here)} m")
        been = np.array(self._been)
        apart = [float(np.hypot(*(been - at).T).min()) for at in found]
        return self._go(found[int(np.argmax(apart))])

    def _draw(self) -> Array:
        """(K, 2) of DRAWS places, those where it fits."""
        sight, area = self.space.sight, self.route.area_m
        least = sight.least_m[:2] if area is None else np.array(area[:2])
        most = sight.most_m[:2] if area is None else np.array(area[2:])
        drawn = self.rng.uniform(least, most, (DRAWS, 2))
        places: Array = drawn[self.space.fits(drawn)]
        return places

    def _go(self, at: Array) -> Point2:
        self._been.append(at)
        return float(at[0]), float(at[1])


def _shown(at: Point2) -> str:
    return f"({at[0]:.2f}, {at[1]:.2f})"
