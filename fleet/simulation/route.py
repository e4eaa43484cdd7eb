"""Where a simulated robot drives: a closed curve on the floor at constant speed."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3


@dataclass(frozen=True, slots=True)
class Route:
    """An ellipse around (x, y) with half axes (a, b), starting at `phase_rad`, left-turning."""

    centre_m: tuple[float, float]
    half_axes_m: tuple[float, float]
    phase_rad: float
    speed_m_s: float


def drive(route: Route, t_s: Array) -> Array:
    """T_map_base (N, 4, 4) at `t_s` (N,): x forward along the curve, z up."""
    a, b = route.half_axes_m
    angle = _angles(route, t_s)
    p = np.zeros((len(t_s), 3))
    p[:, 0] = route.centre_m[0] + a * np.cos(angle)
    p[:, 1] = route.centre_m[1] + b * np.sin(angle)
    heading = np.arctan2(b * np.cos(angle), -a * np.sin(angle))
    zero = np.zeros_like(heading)
    q_wxyz = np.stack([np.cos(heading / 2), zero, zero, np.sin(heading / 2)], axis=-1)
    return se3.from_p_q(p, q_wxyz)


def _angles(route: Route, t_s: Array, samples: int = 4096) -> Array:
    """The curve parameter by arc length, from a fine table of one round."""
    a, b = route.half_axes_m
    table = route.phase_rad + np.linspace(0.0, 2.0 * np.pi, samples)
    chords = np.hypot(a * np.diff(np.cos(table)), b * np.diff(np.sin(table)))
    length = np.concatenate([[0.0], np.cumsum(chords)])
    rounds, rest = np.divmod(route.speed_m_s * t_s, length[-1])
    angle: Array = np.interp(rest, length, table) + 2.0 * np.pi * rounds
    return angle
