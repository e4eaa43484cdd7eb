"""What a protection level promises, and how likely tags are to be wrong."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from tagmap.conventions import Array, Index
from tagmap.errors import ConfigError

MOST_WRONG = 2
# At most this share of the risk goes to more wrong tags at once than are looked at.
_LEFT_OUT_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Promise:
    """`risk` bounds the probability that a pose is further off than its protection level.

    p_false_alarm  of rejecting an explanation that is right; part of the risk
    p_wrong        of any one tag: moved by however much, or another tag's name, by itself
    p_swapped      of any two tags of a view having each other's names; 0: names are certain
    """

    risk: float = 1e-4
    p_false_alarm: float = 1e-5
    p_wrong: float = 1e-3
    p_swapped: float = 1e-3

    def __post_init__(self) -> None:
        if not 0.0 < self.p_false_alarm < self.risk < 1.0:
            raise ConfigError(
                f"risk {self.risk:g} and p_false_alarm {self.p_false_alarm:g}: "
                "expected 0 < p_false_alarm < risk < 1"
            )
        if not (0.0 <= self.p_wrong < 1.0 and 0.0 <= self.p_swapped < 1.0):
            raise ConfigError(
                f"p_wrong {self.p_wrong:g} and p_swapped {self.p_swapped:g}: expected 0 to 1"
            )

    @classmethod
    def at(cls, risk: float = 1e-4, **stated: float) -> "Promise":
        """Where nothing else is stated, a tenth of the risk goes to false alarms."""
        return cls(risk, **({"p_false_alarm": 0.1 * risk} | stated))

    def most_wrong(self, n: int) -> int:
        """So many of n tags may be wrong at once; more are too unlikely, or too many to check."""
        most = 0
        while (
            most < MOST_WRONG
            and float(_p_more(n, most, self.p_wrong)) > _LEFT_OUT_SHARE * self.risk
        ):
            most += 1
        return most

    def p_more(self, n: Index | int, most: int) -> Array:
        """(...) that more than `most` of n (...) tags are wrong, or one beside a swapped pair."""
        return _p_more(n, most, self.p_wrong) + self.p_swapped * _p_more(n, 0, self.p_wrong)


def _p_more(n: Index | int, most: int, p: float) -> Array:
    """The binomial distribution's tail."""
    left = np.asarray(n, dtype=np.float64) - most
    tail = special.betainc(most + 1.0, np.maximum(left, 1.0), p)
    return np.asarray(np.where(left > 0.0, tail, 0.0), dtype=np.float64)


def bounds(degrees: Index, p: float) -> Array:
    """chi2 (...) that `degrees` (...) of freedom exceed with probability p; inf for none."""
    found = special.chdtri(np.maximum(degrees, 1), p)
    return np.asarray(np.where(degrees > 0, found, np.inf), dtype=np.float64)


def radius(cov: Array, p: Array) -> Array:
    """A distance (...) that an error of cov (..., d, d) exceeds with probability p (...) at most.

    The better of two bounds, at most a sixth more than the best there is: the ball around the
    whole ellipsoid, and the diagonal of the box around its axes.
    """
    ball, box = ball_and_box(p, cov.shape[-1])
    variances = np.linalg.eigvalsh(cov)
    square = np.minimum(ball * variances[..., -1], box * variances.sum(-1))
    return np.asarray(np.sqrt(square), dtype=np.float64)


def ball_and_box(p: Array | float, d: int) -> tuple[Array, Array]:
    """Squares (...) of the ball's radius and of the box's half side, in standard deviations."""
    return np.asarray(special.chdtri(d, p)), np.asarray(special.ndtri(p / (2.0 * d)) ** 2)
