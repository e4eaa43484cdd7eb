"""What the wheels say: dead reckoning with everything that wheels have wrong."""

from dataclasses import dataclass

import numpy as np

from fleet.simulation.scenario.physics import Odometry
from fleet.simulation.world.motion import TICK_NS, Motion, between
from tagmap.conventions import Array


@dataclass(frozen=True, slots=True)
class DeadReckoning:
    """pose (N + 1, 3) at each tick of the motion: from the start of its epoch."""

    motion: Motion
    pose: Array

    def at(self, t_ns: int) -> tuple[int, float, float, float]:
        """Epoch, x, y in m, theta in rad, not wrapped."""
        epochs, start_ns = self.motion.epoch, self.motion.start_ns
        k = min(max((t_ns - start_ns) // TICK_NS, 0), len(epochs) - 1)
        epoch, *following = epochs[k : k + 2].tolist()
        # A tick at whose end another epoch begins is no way from one to the other.
        is_last = following not in ([], [epoch])
        x, y, theta = (self.pose[k] if is_last else between(self.pose, start_ns, t_ns)).tolist()
        return epoch, x, y, theta


def reckon(motion: Motion, wrong: Odometry, rng: np.random.Generator) -> DeadReckoning:
    """Lengths and turns are each wrong by a constant share, the heading drifts with the way, and
    both walk at random; now and then the wheels slip. What is carried does not roll."""
    forward, sideways, turn = _increments(motion)
    way = np.hypot(forward, sideways)
    length, angle, drift = rng.standard_normal(3) * [
        wrong.scale,
        wrong.turn_scale,
        wrong.drift_rad_per_m,
    ]
    walk = np.sqrt(way)[:, None] * rng.standard_normal((len(way), 3))
    slips = (rng.random(len(way)) < wrong.slips_per_m * way)[:, None] * rng.standard_normal(
        (len(way), 2)
    )
    turned = rng.standard_normal(len(way)) * np.sqrt(np.abs(turn)) * wrong.turn_noise_rad
    # Wheels that drive straight ahead do not feel what is sideways.
    lateral = np.where(np.abs(sideways) > 1e-9, wrong.noise_m * walk[:, 1], 0.0)
    ahead = (1.0 + length) * forward + wrong.noise_m * walk[:, 0] + wrong.slip_m * slips[:, 0]
    aside = (1.0 + length) * sideways + lateral
    around = (1.0 + angle) * turn + drift * way + wrong.noise_rad * walk[:, 2] + turned
    return DeadReckoning(motion, _sum(ahead, aside, around + wrong.slip_rad * slips[:, 1], motion))


def _increments(motion: Motion) -> tuple[Array, Array, Array]:
    """Forward, sideways (m) and turn (rad) of each tick (N,) in base at its middle."""
    step = np.diff(motion.pose, axis=0) * ~motion.carried[:, None]
    middle = 0.5 * (motion.pose[1:, 2] + motion.pose[:-1, 2])
    c, s = np.cos(middle), np.sin(middle)
    return c * step[:, 0] + s * step[:, 1], c * step[:, 1] - s * step[:, 0], step[:, 2]


def _sum(ahead: Array, aside: Array, around: Array, motion: Motion) -> Array:
    """(N + 1, 3), each epoch from 0."""
    pose = np.zeros((len(ahead) + 1, 3))
    starts = np.flatnonzero(np.diff(motion.epoch, prepend=-1))
    for first, last in zip(starts, [*starts[1:], len(pose)], strict=True):
        ticks = slice(first, last - 1)
        theta = np.concatenate([[0.0], np.cumsum(around[ticks])])
        middle = 0.5 * (theta[1:] + theta[:-1])
        c, s = np.cos(middle), np.sin(middle)
        x = np.cumsum(c * ahead[ticks] - s * aside[ticks])
        y = np.cumsum(s * ahead[ticks] + c * aside[ticks])
        pose[first:last, 2] = theta
        pose[first + 1 : last, 0], pose[first + 1 : last, 1] = x, y
    return pose
