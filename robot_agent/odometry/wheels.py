"""One odometry step between two poses, and how far it may be wrong."""

import math
from typing import Annotated, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta

from robot_agent.odometry.odometry import OdomPose
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.records import Odometry
from tagmap.records.arrays import transform, upper

LONGEST_STEP_M = 1e4
"""After such a way nothing is left to be known."""
NOTHING_KNOWN_RAD2 = math.pi**2
UNRELATED = 1e-9
"""Share of each variance that no other explains, so that rounding leaves it a covariance."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)

Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Floor: TypeAlias = Annotated[float, Meta(ge=1e-5, le=1.0)]


class Wheels(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Standard deviations: of the way after 1 m, along and across it; of the heading after a turn
    of 1 rad, and after 1 m; variances grow with the way and the turn. The floors and `out_of_plane`
    (z m, roll rad, pitch rad: how the robot sways) count once per step; so does `uneven_per_m` (of
    the same), times the way: a step is short against the waves of a floor.
    """

    forward_share: Share = 0.01
    lateral_share: Share = 0.005
    turn_share: Share = 0.01
    turn_rad_per_m: Share = 0.01
    uneven_per_m: tuple[Share, Share, Share] = (0.0, 0.0, 0.0)
    floor_m: Floor = 0.0005
    floor_rad: Floor = 0.0005
    out_of_plane: tuple[Floor, Floor, Floor] = (0.0005, 0.0005, 0.0005)


def step(prev: OdomPose, cur: OdomPose, wheels: Wheels) -> Odometry | None:
    """From prev to cur; None where nothing links them: another epoch, or too long a way."""
    if _stands(prev, cur):
        return Odometry(T_prev_cur=transform(np.eye(4)), cov=upper(_settled(0.0, 0.0, wheels)))
    T_prev_cur = se3.inverse(prev.T_odom_base) @ cur.T_odom_base
    way_m = max(abs(cur.path_m - prev.path_m), math.dist(T_prev_cur[:3, 3], (0.0, 0.0, 0.0)))
    turn_rad = abs(cur.turn_rad - prev.turn_rad)
    if prev.epoch != cur.epoch or way_m > LONGEST_STEP_M:
        return None
    cov = covariance(se3.log(T_prev_cur), way_m, turn_rad, wheels)
    return Odometry(T_prev_cur=transform(T_prev_cur), cov=upper(cov))


def _stands(prev: OdomPose, cur: OdomPose) -> bool:
    """Most steps of a robot that looks around or shoots."""
    is_driven = (prev.epoch, prev.path_m, prev.turn_rad) != (cur.epoch, cur.path_m, cur.turn_rad)
    return not is_driven and bool((prev.T_odom_base == cur.T_odom_base).all())


def covariance(xi: Array, way_m: float, turn_rad: float, wheels: Wheels) -> Array:
    """(6, 6) in cur of a step with tangent `xi` (6,) on which `way_m` and `turn_rad` were driven.

    Errors arise evenly along the arc exp(s xi), 0 <= s <= 1, and are carried to its end by the
    adjoint, so steps along one arc add up to the whole (Sola, Deray, Atchuthan, A micro Lie
    theory, 2018, section V). Of a way that is longer than the arc nothing but its length is known:
    a heading that was wrong on a detour of length d counts with the lever of one out and back,
    whose mean square is d^2 / 12. After more than half a turn the arc is not known either.
    """
    arc_m = float(np.linalg.norm(xi[:3])) if turn_rad < math.pi else 0.0
    yaw_var = wheels.turn_share**2 * turn_rad + wheels.turn_rad_per_m**2 * way_m
    yaw_var = min(yaw_var, NOTHING_KNOWN_RAD2)
    detour_var = yaw_var * max(0.0, way_m - arc_m) ** 2 / 12.0
    along_var = wheels.forward_share**2 * way_m + detour_var
    across_var = wheels.lateral_share**2 * way_m + detour_var
    variances = np.array([along_var, across_var, 0.0, 0.0, 0.0, yaw_var])
    left_to_go = 0.5 * (1.0 - _NODES)
    Ad = se3.adjoint(se3.exp(-left_to_go[:, None] * xi))
    arising = 0.5 * _WEIGHTS[:, None, None] * variances
    cov: Array = (arising * Ad @ Ad.swapaxes(-1, -2)).sum(axis=0)
    return _settled(0.5 * (cov + cov.T), way_m, wheels)


def _settled(arisen: Array | float, way_m: float, wheels: Wheels) -> Array:
    """With what counts once per step."""
    z, roll_rad, pitch_rad = np.hypot(wheels.out_of_plane, np.multiply(wheels.uneven_per_m, way_m))
    floors = [wheels.floor_m, wheels.floor_m, z, roll_rad, pitch_rad, wheels.floor_rad]
    cov: Array = arisen + np.diag(np.square(floors))
    return cov + UNRELATED * np.diag(np.diag(cov))
