"""The trigonometric quotients of the exponential maps, accurate down to and at zero.

Where the closed form cancels, below SMALL_RAD, a quotient is its Taylor series. The switch sits
where both still agree to better than 1e-13.
"""

from collections.abc import Callable
from math import factorial

import numpy as np

from tagmap.conventions import Array

SMALL_RAD = 0.5

# Coefficients of t^(2 k), highest power first.
SINE_3 = [(-1) ** k / factorial(2 * k + 3) for k in reversed(range(7))]
_COSINE_4 = [(-1) ** k / factorial(2 * k + 4) for k in reversed(range(7))]
_MIXED_5 = [(-1) ** k * (k + 1) / factorial(2 * k + 5) for k in reversed(range(7))]
COTANGENT = [691 / 1307674368000, 1 / 47900160, 1 / 1209600, 1 / 30240, 1 / 720, 1 / 12]


def sine_quotient(theta: Array) -> Array:
    """sin(t) / t, 1 at 0."""
    return np.sinc(theta / np.pi)


def cosine_quotient(theta: Array) -> Array:
    """(1 - cos(t)) / t^2 = (sin(t / 2) / t)^2 2, 1/2 at 0."""
    half = np.sinc(theta / (2.0 * np.pi))
    return 0.5 * half * half


def sine_remainder(theta: Array) -> Array:
    """(t - sin(t)) / t^3, 1/6 at 0."""
    return _quotient(theta, SINE_3, lambda t: (t - np.sin(t)) / t**3)


def cosine_remainder(theta: Array) -> Array:
    """(t^2 + 2 cos(t) - 2) / (2 t^4), 1/24 at 0."""
    return _quotient(theta, _COSINE_4, lambda t: (t * t + 2.0 * np.cos(t) - 2.0) / (2.0 * t**4))


def mixed_remainder(theta: Array) -> Array:
    """(2 t - 3 sin(t) + t cos(t)) / (2 t^5), 1/120 at 0."""
    return _quotient(
        theta, _MIXED_5, lambda t: (2.0 * t - 3.0 * np.sin(t) + t * np.cos(t)) / (2.0 * t**5)
    )


def cotangent_remainder(theta: Array) -> Array:
    """(1 - (t / 2) cot(t / 2)) / t^2, 1/12 at 0; for |t| < 2 pi."""
    return _quotient(theta, COTANGENT, lambda t: (1.0 - 0.5 * t / np.tan(0.5 * t)) / t**2)


def _quotient(theta: Array, series: list[float], closed: Callable[[Array], Array]) -> Array:
    small = np.abs(theta) < SMALL_RAD
    if small.all():
        return _horner(theta * theta, series)
    if not small.any():
        return closed(theta)
    near = _horner(np.where(small, theta * theta, 0.0), series)
    return np.where(small, near, closed(np.where(small, 1.0, theta)))


def _horner(square: Array, series: list[float]) -> Array:
    value: Array = series[0] * square + series[1]
    for coefficient in series[2:]:
        value = value * square + coefficient
    return value
