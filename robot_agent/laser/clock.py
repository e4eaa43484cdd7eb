"""The robot's clock for everything that ends: it never jumps and goes on while the robot sleeps."""

import time

_BOOT = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
_RAW = getattr(time, "CLOCK_MONOTONIC_RAW", time.CLOCK_MONOTONIC)


def now_ns() -> int:
    return time.clock_gettime_ns(_BOOT)


def second_ns() -> int:
    """Another clock, to tell whether the first one may be believed: it stands still in sleep, and
    nobody sets its rate."""
    return time.clock_gettime_ns(_RAW)
