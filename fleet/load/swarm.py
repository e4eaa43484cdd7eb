"""Many robots under many tags: the load that is put on store and service."""

import math
from dataclasses import dataclass

import numpy as np

from fleet.load.building import Building, building
from fleet.load.rover import Rover
from fleet.simulation.route import Route
from fleet.simulation.sensing import RIG
from tagmap.records import Hello, Keyframe

TAGS = 60
SPACING_M = 3.0
# Under these, robots see 6 to 12 tags almost everywhere, if they report no more than that.
SPREAD_M, MOST = 2.5, 12
# Ellipses reach into their neighbours', so that all robots share tags with others.
REACH = (0.55, 0.75)
HALF_AXIS_M = (5.0, 12.0)
MARGIN_M = 3.5


@dataclass(frozen=True, slots=True)
class Member:
    """One robot's session; `keyframes` in the order of seq."""

    hello: Hello
    keyframes: list[Keyframe]


def swarm(seed: int, robots: int, keyframes: int, rate_hz: float, site: str) -> list[Member]:
    """`robots` in a hall with 60 tags, all of them identified: the same seed, the same bits."""
    drivers = rovers(seed, robots, TAGS, site)
    return [Member(one.hello, list(one.drive(keyframes, rate_hz))) for one in drivers]


def rovers(
    seed: int,
    robots: int,
    tags: int,
    site: str,
    spacing_m: float = SPACING_M,
    most: int | None = None,
) -> list[Rover]:
    """`robots` on ellipses that fill a hall with `tags` under its ceiling."""
    world, *noise = np.random.SeedSequence(seed).spawn(1 + robots)
    hall = building(np.random.default_rng(world), tags, spacing_m)
    found = []
    for number, own in enumerate(noise, start=1):
        rng = np.random.default_rng(own)
        route = _route(hall, number - 1, robots, rng)
        found.append(Rover(_hello(site, number), hall, route, most, rng))
    return found


def _hello(site: str, number: int) -> Hello:
    return Hello(
        site=site,
        robot=f"r{number}",
        number=number,
        session=f"session-{number}",
        kind="spatial",
        rig=RIG,
    )


def _route(hall: Building, n: int, robots: int, rng: np.random.Generator) -> Route:
    """Around the middle of one of as many cells as there are robots."""
    rows = max(1, round(math.sqrt(robots * hall.width_m / hall.length_m)))
    columns = math.ceil(robots / rows)
    column, row = divmod(n, rows)
    sizes_m = np.array([hall.length_m / columns, hall.width_m / rows])
    middle_m = sizes_m * (np.array([column, row]) + 0.5)
    half_m = np.clip(sizes_m * rng.uniform(*REACH, 2), *HALF_AXIS_M)
    inside_m = np.array([hall.length_m, hall.width_m]) - half_m - MARGIN_M
    centre_m = np.maximum(np.minimum(middle_m, inside_m), half_m + MARGIN_M)
    return Route(
        centre_m=(float(centre_m[0]), float(centre_m[1])),
        half_axes_m=(float(half_m[0]), float(half_m[1])),
        phase_rad=rng.uniform(0.0, 2.0 * np.pi),
        speed_m_s=rng.uniform(0.6, 1.0),
    )
