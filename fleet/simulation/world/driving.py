"""How a robot gets along its way: turns, drives, stops, within its limits of acceleration."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fleet.simulation.scenario.fields import Point2
from fleet.simulation.scenario.robot import Route
from fleet.simulation.world.motion import TICK_S, Motion
from tagmap.conventions import Array, Index, Mask

OMNI_TURN_RAD_M = 0.25
"""A robot that need not turn to drive turns a little all the same: it sees more."""
NO_TURN_RAD = 1e-6


class Ways(Protocol):
    def next(self, here: Point2) -> Point2:
        """Where to go from `here`."""


@dataclass(frozen=True, slots=True)
class Jump:
    """At tick `at` the odometry starts anew; where `to` is given (x, y, theta) the robot is carried
    there first, for `ticks`."""

    at: int
    ticks: int
    to: tuple[float, float, float] | None


@dataclass(frozen=True, slots=True)
class Phase:
    """pose (n, 3) at the end of each of n ticks."""

    pose: Array
    moving: bool


def drive(
    route: Route, omni: bool, ways: Ways, start: Array, n: int, jumps: list[Jump], start_ns: int
) -> Motion:
    """For n ticks from `start` (3,); jumps in order."""
    pose, moving = np.tile(start, (n + 1, 1)), np.zeros(n, dtype=bool)
    carried, epoch = np.zeros(n, dtype=bool), np.zeros(n + 1, dtype=np.int64)
    done = 0
    for jump in [*jumps, None]:
        end = n if jump is None else min(n, max(jump.at, done))
        for phase in _phases(route, omni, ways, pose[done].copy(), waits=done == 0):
            k = min(len(phase.pose), end - done)
            pose[done + 1 : done + k + 1] = phase.pose[:k]
            moving[done : done + k] = phase.moving
            done += k
            if done == end:
                break
        if jump is not None and done < n:
            done = _jump(jump, pose, done, moving, carried, epoch)
    return Motion(start_ns, pose, moving, carried, epoch)


def _jump(jump: Jump, pose: Array, done: int, moving: Mask, carried: Mask, epoch: Index) -> int:
    """The tick after it."""
    n, here = len(moving), pose[done].copy()
    end = done
    if jump.to is not None:
        end = min(n, done + max(1, jump.ticks))
        there = np.array(jump.to)
        there[2] = here[2] + math.remainder(there[2] - here[2], 2.0 * math.pi)
        share = np.arange(1, end - done + 1)[:, None] / max(1, jump.ticks)
        pose[done + 1 : end + 1] = here + share * (there - here)
        moving[done:end] = carried[done:end] = True
    pose[end:] = pose[end]
    epoch[end:] += 1
    return end


def _phases(route: Route, omni: bool, ways: Ways, pose: Array, waits: bool) -> Iterator[Phase]:
    """Without end. Every phase takes at least one tick."""
    if waits and route.wait_s > 0.0:
        yield _stand(pose, route.wait_s)
    while True:
        target = np.array(ways.next((float(pose[0]), float(pose[1]))))
        way = target - pose[:2]
        length = float(np.hypot(*way))
        if length < 1e-3:
            yield _stand(pose, max(route.stop_s, 1.0))
            continue
        if not omni:
            turn = math.remainder(math.atan2(way[1], way[0]) - pose[2], 2.0 * math.pi)
            if abs(turn) > NO_TURN_RAD:
                share = profile(abs(turn), route.turn_rad_s, route.turn_rad_s2) / abs(turn)
                yield (phase := _go(pose, np.array([0.0, 0.0, turn]), share))
                pose = phase.pose[-1]
        pieces = max(1, round(length / route.every_m))
        piece = length / pieces
        step = np.append(way / pieces, OMNI_TURN_RAD_M * piece if omni else 0.0)
        share = profile(piece, route.speed_m_s, route.acceleration_m_s2) / piece
        for _ in range(pieces):
            yield (phase := _go(pose, step, share))
            pose = phase.pose[-1]
            if route.stop_s > 0.0:
                yield _stand(pose, route.stop_s)


def _stand(pose: Array, duration_s: float) -> Phase:
    return Phase(np.tile(pose, (max(1, round(duration_s / TICK_S)), 1)), False)


def _go(pose: Array, step: Array, share: Array) -> Phase:
    return Phase(pose + share[:, None] * step, True)


def profile(distance: float, speed: float, acceleration: float) -> Array:
    """How far (n,) at the end of each tick: up to speed, on, and down again, ending at `distance`.

    The time is rounded up to whole ticks, so the limits are kept.
    """
    speed = min(speed, math.sqrt(distance * acceleration))
    ramp_s = speed / acceleration
    total_s = ramp_s + distance / speed
    n = max(1, math.ceil(total_s / TICK_S))
    t = np.arange(1, n + 1) / n * total_s
    left = total_s - t
    up, down = 0.5 * acceleration * t**2, distance - 0.5 * acceleration * left**2
    even = speed * (t - 0.5 * ramp_s)
    s: Array = np.where(t < ramp_s, up, np.where(left < ramp_s, down, even))
    return s
