"""Dead reckoning of a planar robot from velocity commands, with a stated error model."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array, Index
from tagmap.geometry import se2


@dataclass(frozen=True, slots=True)
class PlanarOdometryNoise:
    """Random walk of the dead-reckoned pose, body axes, while driving; `still_ratio` of it at rest.

    v_scale_sigma, w_scale_sigma  how far the wheels may drive more or less than commanded, alike
                                  during a whole step
    floor_m, floor_rad            time stamps and rounding of the commands, once per step
    """

    forward_m_per_sqrt_s: float = 0.010
    lateral_m_per_sqrt_s: float = 0.003
    heading_rad_per_sqrt_s: float = 0.015
    still_ratio: float = 0.1
    v_scale_sigma: float = 0.05
    w_scale_sigma: float = 0.05
    floor_m: float = 0.001
    floor_rad: float = 0.002


@dataclass(frozen=True, slots=True)
class Commands:
    """Velocities v (m/s), w (rad/s) that hold from t_ns[i] until t_ns[i + 1], at most `hold_ns`.

    Before the first command the robot stands. Where a command would have to hold longer, nothing
    is known about the motion.
    """

    t_ns: Index
    v: Array
    w: Array
    hold_ns: int = 2_000_000_000


@dataclass(frozen=True, slots=True)
class PlanarSteps:
    """N - 1 steps between N instants: T_prev_cur (., 3, 3), cov in cur (., 3, 3), known (.,)."""

    T_prev_cur: Array
    cov: Array
    known: npt.NDArray[np.bool_]


def steps(commands: Commands, t_ns: Index, noise: PlanarOdometryNoise) -> PlanarSteps:
    """Motion between consecutive `t_ns` (N,), sorted; exact arcs between changes of the command.

    Covariance: each arc adds Q dt in its own end frame, and its share of the scale errors, carried
    to the end of the step by the adjoint (Sola, Deray, Atchuthan, A micro Lie theory, 2018).
    """
    knots = np.union1d(commands.t_ns, t_ns)
    knots = knots[(knots >= t_ns[0]) & (knots <= t_ns[-1])]
    dt_s = np.diff(knots) * 1e-9
    v, w, held_ns = _held(commands, knots)
    T_odom_knot = _arcs(v, w, dt_s)
    ends = np.searchsorted(knots, t_ns)
    step = np.searchsorted(ends, np.arange(1, len(knots))) - 1  # that each arc is part of
    T_odom = T_odom_knot[ends]
    T_prev_cur = se2.inverse(T_odom[:-1]) @ T_odom[1:]
    to_cur = se2.adjoint(se2.inverse(T_odom[step + 1]) @ T_odom_knot[1:])
    cov = _sum_by(step, to_cur @ _random_walk(v, w, dt_s, noise) @ np.swapaxes(to_cur, -1, -2))
    sway = _sum_by(step, to_cur @ _scale_errors(v, w, dt_s, noise))
    cov += sway @ np.swapaxes(sway, -1, -2)
    cov += np.diag(np.square([noise.floor_m, noise.floor_m, noise.floor_rad]))
    unknown = _sum_by(step, (held_ns > commands.hold_ns).astype(np.float64))
    return PlanarSteps(T_prev_cur, cov, unknown == 0.0)


def _sum_by(step: Index, values: Array) -> Array:
    """Sums (N - 1, ...) of `values` (K, ...) that belong to the same step."""
    total = np.zeros((step[-1] + 1, *values.shape[1:]))
    np.add.at(total, step, values)
    return total


def _held(commands: Commands, knots: Index) -> tuple[Array, Array, Index]:
    """The command between consecutive knots, and its age at the end of each interval."""
    index = np.searchsorted(commands.t_ns, knots[:-1], side="right") - 1
    started = index >= 0
    v = np.where(started, commands.v[index], 0.0)
    w = np.where(started, commands.w[index], 0.0)
    return v, w, np.where(started, knots[1:] - commands.t_ns[index], 0)


def _arcs(v: Array, w: Array, dt_s: Array) -> Array:
    """T_odom_knot (N + 1, 3, 3). The chord of an arc is v dt sinc(w dt / 2), turned by w dt / 2."""
    half = 0.5 * w * dt_s
    theta = np.concatenate([[0.0], np.cumsum(2.0 * half)])
    chord = v * dt_s * np.sinc(half / np.pi)
    along = theta[:-1] + half
    p = np.zeros((len(theta), 2))
    p[1:] = np.cumsum(np.stack([chord * np.cos(along), chord * np.sin(along)], axis=-1), axis=0)
    return se2.from_p_theta(p, theta)


def _random_walk(v: Array, w: Array, dt_s: Array, noise: PlanarOdometryNoise) -> Array:
    """(K, 3, 3) of each arc, variance growing with time."""
    rate = np.square(
        [noise.forward_m_per_sqrt_s, noise.lateral_m_per_sqrt_s, noise.heading_rad_per_sqrt_s]
    )
    ratio = np.where((v == 0.0) & (w == 0.0), noise.still_ratio**2, 1.0)
    Q: Array = (ratio * dt_s)[:, None, None] * np.diag(rate)
    return Q


def _scale_errors(v: Array, w: Array, dt_s: Array, noise: PlanarOdometryNoise) -> Array:
    """(K, 3, 2): where one standard deviation of the scale of v, and of w, takes each arc's end."""
    errors = np.zeros((len(dt_s), 3, 2))
    errors[:, 0, 0] = noise.v_scale_sigma * v * dt_s
    errors[:, 2, 1] = noise.w_scale_sigma * w * dt_s
    return errors
