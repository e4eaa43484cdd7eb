"""A map of two parts that only two tags join: it may turn about the line through them."""

import numpy as np
from msgspec.structs import replace as changed

from tagmap.estimation.stack import SessionData
from tagmap.geometry import se3
from tagmap.records import Odometry, arrays
from tests.estimation.worlds import Drive, World, hall, session

FIRST, SHARED, SECOND = (0, 1, 2, 3, 4), (5, 6), (7, 8, 9)
N, HALF = 60, 35
SLIP = np.array([0.5, 0.2, 0.0, 0.0, 0.0, 0.6])


def halves(slip: bool) -> tuple[World, SessionData]:
    """A robot that sees FIRST and SHARED up to HALF, then SECOND and SHARED."""
    rng = np.random.default_rng(4)
    world = hall("spatial", rng, 10, spread=0.5)
    data, _ = session(world, Drive(n=N, radius_m=1.5), rng)
    keep = {True: {f"tag{i}" for i in FIRST + SHARED}, False: {f"tag{i}" for i in SECOND + SHARED}}
    frames = [
        changed(f, sightings=tuple(s for s in f.sightings if s.tag in keep[f.seq <= HALF]))
        for f in data.keyframes
    ]
    if slip:
        odom = frames[HALF].odom
        assert odom is not None
        T = arrays.matrix(odom.T_prev_cur) @ se3.exp(SLIP)
        slipped = Odometry(T_prev_cur=arrays.transform(T), cov=odom.cov)
        frames[HALF] = changed(frames[HALF], odom=slipped)
    return world, SessionData(data.hello, frames)
