"""A robot that hardly moves at first, and sees one tag of several with its left camera alone."""

import numpy as np
from msgspec.structs import replace as changed

from tagmap.conventions import Array
from tagmap.estimation.problem import lie
from tagmap.estimation.stack import SessionData
from tagmap.geometry import se3
from tagmap.records import Odometry, Sighting, arrays
from tests.estimation.worlds import (
    KEYFRAME_NS,
    MOUNT,
    ODOM_SIGMA,
    Drive,
    World,
    circle,
    hall,
    in_view,
    measured,
    session,
)

MONO = 3


def standing(n_still: int, n_moving: int, still: float, seed: int) -> tuple[World, SessionData]:
    """still: the part of its usual step by which it moves at first.

    tag3 is seen in directions only, and stays in view; odometry errs as steps are long.
    """
    rng = np.random.default_rng(seed)
    world = hall("spatial", rng, 7, spread=0.4)
    parts = np.concatenate([np.full(n_still - 1, still), np.ones(n_moving)])
    T = _along(np.concatenate([[0.0], np.cumsum(parts)]))
    data, _ = session(world, Drive(n=len(T)), rng)
    steps = se3.inverse(T[:-1]) @ T[1:]
    frames = []
    for i, frame in enumerate(data.keyframes):
        odom = None
        if i:
            sigma = ODOM_SIGMA["spatial"] * max(parts[i - 1], 0.02)
            step = steps[i - 1] @ se3.exp(sigma * rng.standard_normal(6))
            cov = arrays.upper(np.diag(sigma**2))
            odom = Odometry(T_prev_cur=arrays.transform(step), cov=cov)
        frames.append(changed(frame, odom=odom, sightings=tuple(_seen(world, T[i], rng))))
    return world, SessionData(data.hello, frames)


def _along(steps: Array) -> Array:
    """Poses (n, 4, 4) so many steps along a circle."""
    step_s = KEYFRAME_NS * 1e-9
    return np.stack([circle("spatial", Drive(n=1, radius_m=1.5), s * step_s)[0] for s in steps])


def _seen(world: World, T_map_base: Array, rng: np.random.Generator) -> list[Sighting]:
    group = lie("spatial")
    p_cam = group.act(group.inverse(T_map_base @ arrays.matrix(MOUNT["spatial"])), world.p)
    return [
        Sighting(
            tag=f"tag{tag}",
            id_by="given",
            p_false=0.0,
            z=measured("mono_px" if tag == MONO else "stereo_px", "spatial", p_cam[tag], rng),
        )
        for tag in np.flatnonzero(in_view("spatial", p_cam)).tolist()
    ]
