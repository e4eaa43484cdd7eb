"""Times and queues in numbers, and whether a queue grows."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array

# A fit that says that less than this share of what is sent stays behind is level.
LEVEL_SHARE = 0.002
SETTLING = 0.1
MOST_POINTS = 400


@dataclass(frozen=True, slots=True)
class Times:
    """Of `n` keyframes in ms; those still missing count as later than all others, and a percentile
    among them is None."""

    n: int
    missing: int
    p50: float | None
    p95: float | None
    p99: float | None
    max: float | None


def times(elapsed_s: Array) -> Times:
    """elapsed_s (N,), NaN for what never came."""
    missing = int(np.isnan(elapsed_s).sum())
    late = np.sort(np.where(np.isnan(elapsed_s), np.inf, elapsed_s)) * 1e3
    figures = [_at(late, share) for share in (0.5, 0.95, 0.99, 1.0)]
    return Times(len(late), missing, *figures)


def _at(late: Array, share: float) -> float | None:
    if not len(late):
        return None
    value = float(late[min(len(late) - 1, int(np.ceil(share * len(late))) - 1)])
    return round(value, 2) if np.isfinite(value) else None


@dataclass(frozen=True, slots=True)
class Queue:
    """Keyframes that were put and not yet acknowledged.

    slope_per_s    by how many they become more each second: the median of the slopes between all
                   pairs of looks (Theil 1950, Sen 1968), after the first tenth of the time
    first_p90      of the first third of the looks, their 90th percentile
    last_p50       of the last third, their median
    growing        the slope is more than LEVEL_SHARE of what is sent, and at the end there are
                   usually more than there seldom were at the beginning
    """

    p50: float
    p95: float
    max: int
    slope_per_s: float
    first_p90: float
    last_p50: float
    growing: bool


def queue(t_s: Array, waiting: Array, rate_per_s: float) -> Queue:
    """waiting (N,) at times t_s (N,) while `rate_per_s` keyframes are sent."""
    if not len(t_s):
        return Queue(0.0, 0.0, 0, 0.0, 0.0, 0.0, False)
    settled = t_s >= t_s[0] + SETTLING * (t_s[-1] - t_s[0])
    slope = _slope(t_s[settled], waiting[settled])
    third = max(1, len(waiting) // 3)
    first = float(np.percentile(waiting[:third], 90))
    last = float(np.median(waiting[-third:]))
    return Queue(
        p50=float(np.median(waiting)),
        p95=float(np.percentile(waiting, 95)),
        max=int(waiting.max()),
        slope_per_s=round(slope, 3),
        first_p90=first,
        last_p50=last,
        growing=slope > LEVEL_SHARE * rate_per_s and last > first,
    )


def _slope(t_s: Array, values: Array) -> float:
    step = -(-len(t_s) // MOST_POINTS)
    t, y = t_s[::step], values[::step]
    i, j = np.triu_indices(len(t), 1)
    apart = t[j] > t[i]
    slopes = (y[j] - y[i])[apart] / (t[j] - t[i])[apart]
    return float(np.median(slopes)) if len(slopes) else 0.0
