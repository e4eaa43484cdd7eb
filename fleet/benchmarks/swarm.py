"""Many robots under many tags: the load that the benchmarks put on store and service."""

from dataclasses import dataclass

import numpy as np

from fleet.simulation.hall import tag_id
from fleet.simulation.route import Route, drive
from fleet.simulation.sensing import RIG, Seeing, Wheels, roll, sight, tilted_camera
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.records import Hello, Keyframe
from tagmap.records.arrays import transform

COLUMNS, ROWS = 10, 6
SPACING_M = 3.0
CEILING_M = 3.5
T_BASE_CAM = tilted_camera(np.deg2rad(40.0), (0.1, 0.15, 0.6))
START_NS = 1_700_000_000_000_000_000


@dataclass(frozen=True, slots=True)
class Member:
    """One robot's session; `keyframes` in the order of seq."""

    hello: Hello
    keyframes: list[Keyframe]


def swarm(seed: int, robots: int, keyframes: int, rate_hz: float, site: str) -> list[Member]:
    """`robots` on ellipses through a hall with 60 tags under its ceiling, all of them identified.

    The same seed makes the same keyframes, bit for bit.
    """
    world, *noise = np.random.SeedSequence(seed).spawn(1 + robots)
    tags = _tags(np.random.default_rng(world))
    t_s = np.arange(keyframes) / rate_hz
    members = []
    for number, own in enumerate(noise, start=1):
        rng = np.random.default_rng(own)
        members.append(_member(number, site, t_s, drive(_route(rng), t_s), tags, rng))
    return members


def _tags(rng: np.random.Generator) -> dict[str, Array]:
    tags = {}
    for n in range(COLUMNS * ROWS):
        column, row = divmod(n, ROWS)
        x, y = SPACING_M * (np.array([column, row]) + 0.5) + rng.uniform(-0.8, 0.8, 2)
        tags[tag_id(n + 1)] = np.array([x, y, CEILING_M - rng.uniform(0.0, 0.5)])
    return tags


def _route(rng: np.random.Generator) -> Route:
    """Somewhere inside, long enough to see a third of the hall."""
    length_m, width_m = SPACING_M * COLUMNS, SPACING_M * ROWS
    return Route(
        centre_m=(rng.uniform(0.3, 0.7) * length_m, rng.uniform(0.45, 0.55) * width_m),
        half_axes_m=(rng.uniform(0.2, 0.28) * length_m, rng.uniform(0.3, 0.4) * width_m),
        phase_rad=rng.uniform(0.0, 2.0 * np.pi),
        speed_m_s=rng.uniform(0.6, 1.0),
    )


def _member(
    number: int,
    site: str,
    t_s: Array,
    track: Array,
    tags: dict[str, Array],
    rng: np.random.Generator,
) -> Member:
    robot, session = f"r{number}", f"session-{number}"
    t_ns = START_NS + np.rint(t_s * 1e9).astype(np.int64)
    step = se3.inverse(track[:-1]) @ track[1:]
    wheels, seeing, T_base_cam = Wheels(), Seeing(), transform(T_BASE_CAM)
    keyframes = [
        Keyframe(
            site=site,
            robot=robot,
            session=session,
            seq=k + 1,
            t_ns=int(t_ns[k]),
            odom=roll(step[k - 1], wheels, rng) if k else None,
            T_base_cam=T_base_cam,
            sightings=sight(track[k] @ T_BASE_CAM, tags, seeing, rng),
        )
        for k in range(len(t_s))
    ]
    hello = Hello(site=site, robot=robot, number=number, session=session, kind="spatial", rig=RIG)
    return Member(hello, keyframes)
