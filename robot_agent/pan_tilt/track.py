"""The angles at the time of an exposure, from readings before and after it."""

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from robot_agent.pan_tilt.unit import Angles, AxisSample, Reading

NS = 1e-9
KEPT = 256
LONGEST_GAP_S = 0.5
"""In a longer gap a unit can have gone anywhere and come back."""


@dataclass(frozen=True, slots=True)
class Pointing:
    """Angles with the standard deviations of their errors, taken as independent.

    rests: neither axis turned, as far as readings tell.
    """

    angles: Angles
    sigma_pan_rad: float
    sigma_tilt_rad: float
    rests: bool


@dataclass(slots=True)
class PointingTrack:
    """The latest readings, in order of time."""

    _pan: deque[AxisSample] = field(default_factory=lambda: deque(maxlen=KEPT))
    _tilt: deque[AxisSample] = field(default_factory=lambda: deque(maxlen=KEPT))

    def add(self, reading: Reading) -> None:
        """A reading that is not later than the one before, as when a clock is set, begins anew."""
        for kept, sample in ((self._pan, reading.pan), (self._tilt, reading.tilt)):
            if kept and sample.t_ns <= kept[-1].t_ns:
                kept.clear()
            kept.append(sample)

    def reaches(self, t_ns: int) -> bool:
        """Whether both axes were read after `t_ns`."""
        return all(samples and samples[-1].t_ns > t_ns for samples in (self._pan, self._tilt))

    def at(self, t_ns: int) -> Pointing | None:
        """Interpolated, never extrapolated: None unless both axes were read before and after
        `t_ns`, no more than LONGEST_GAP_S apart."""
        pan, tilt = interpolate(self._pan, t_ns), interpolate(self._tilt, t_ns)
        if pan is None or tilt is None:
            return None
        rests = _rests(self._pan, t_ns) and _rests(self._tilt, t_ns)
        return Pointing(Angles(pan[0], tilt[0]), pan[1], tilt[1], rests)


def interpolate(samples: Sequence[AxisSample], t_ns: int) -> tuple[float, float] | None:
    """Angle and its standard deviation, rad.

    Three independent errors: the step (uniform), the time of the samples (uniform, times the
    speed), and that the axis did not turn evenly in between. For the last: with speed v0 before a
    gap of length h and v2 after it, and one change of speed anywhere within, a straight line is off
    by at most h |v2 - v0| / 4; steady acceleration is off by less.
    """
    k = bisect_right(samples, t_ns, key=lambda sample: sample.t_ns)
    if k == 0 or k == len(samples):
        return None
    a, b = samples[k - 1], samples[k]
    gap_s = (b.t_ns - a.t_ns) * NS
    if gap_s > LONGEST_GAP_S:
        return None
    s = (t_ns - a.t_ns) * NS / gap_s
    speed = _speed(a, b)
    before = _speed(samples[k - 2], a) if k > 1 else None
    after = _speed(b, samples[k + 1]) if k + 1 < len(samples) else None
    step = max(a.step_rad, b.step_rad) / 12.0**0.5
    timing = abs(speed) * max(a.within_ns, b.within_ns) * NS / 3.0**0.5
    uneven = gap_s * _change(before, speed, after) / 4.0 / 3.0**0.5
    angle_rad = a.angle_rad + s * (b.angle_rad - a.angle_rad)
    return angle_rad, (step**2 + timing**2 + uneven**2) ** 0.5


def _rests(samples: Sequence[AxisSample], t_ns: int) -> bool:
    """The two readings before `t_ns` and the two after it are alike, as far as there are two."""
    k = bisect_right(samples, t_ns, key=lambda sample: sample.t_ns)
    near = [samples[i].angle_rad for i in range(max(k - 2, 0), min(k + 2, len(samples)))]
    return len(set(near)) == 1


def _speed(a: AxisSample, b: AxisSample) -> float:
    return (b.angle_rad - a.angle_rad) / ((b.t_ns - a.t_ns) * NS)


def _change(before: float | None, speed: float, after: float | None) -> float:
    """How much the speed changed over the gap. With one neighbour missing the change up to the
    middle counts twice; with both, the axis may as well have stood."""
    if before is not None and after is not None:
        return max(abs(after - before), abs(after - speed), abs(speed - before))
    known = before if before is not None else after
    return 2.0 * abs(speed - (0.0 if known is None else known))
