"""What a base controller says, made into poses: the latest readings of one epoch."""

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from robot_agent.odometry.datagram import Datagram, Reckoned
from robot_agent.odometry.odometry import OdomPose
from tagmap.conventions import Array
from tagmap.geometry import se3

NS = 1e-9
KEPT = 2048
LONGEST_GAP_S = 0.5
"""In a longer gap a robot can have gone anywhere and come back."""
HALF_TURN_RAD = math.pi
LATE_S = 1.0
"""What looks old for so long, with nothing new, is not late: it was begun anew."""
EPOCHS = 16
"""So many that were left are remembered."""
SLACK_M, SLACK_RAD = 0.05, 0.05
"""How far readings at one moment may be apart: times are not exact."""


class News(Enum):
    """NEXT: a reading. ANEW: the first one of an epoch. OLD: it came late or twice."""

    NEXT, ANEW, OLD = range(3)


@dataclass(frozen=True, slots=True)
class Speeds:
    """What a robot cannot exceed: a reading further away was not driven."""

    most_m_s: float = 5.0
    most_rad_s: float = 10.0


@dataclass(frozen=True, slots=True)
class _Kept:
    """A reading, with the way and the turn up to it."""

    reading: Reckoned
    path_m: float
    turn_rad: float


@dataclass(slots=True)
class OdometryTrack:
    """Datagrams in the order of arrival; poses of one epoch are never mixed with another's."""

    speeds: Speeds
    epoch: int = -1
    _kept: deque[_Kept] = field(default_factory=lambda: deque(maxlen=KEPT))
    _latest: Datagram | None = None
    _heard_ns: int = 0
    _left: deque[int] = field(default_factory=lambda: deque(maxlen=EPOCHS))

    def add(self, datagram: Datagram, heard_ns: int) -> News:
        """heard_ns: of a clock that only goes forward."""
        news = self._news(datagram, heard_ns)
        if news is News.OLD:
            return news
        if news is News.ANEW:
            self._begin(datagram)
        self._keep(datagram.reckoned)
        self._latest, self._heard_ns = datagram, heard_ns
        return news

    def reaches(self, t_ns: int) -> bool:
        """Whether there is a reading at `t_ns` or after it."""
        return bool(self._kept) and self._kept[-1].reading.t_ns >= t_ns

    def at(self, t_ns: int) -> OdomPose | None:
        """Interpolated, never extrapolated: None unless there is a reading at `t_ns`, or one before
        and one after it, at most LONGEST_GAP_S and half a turn apart."""
        k = bisect_left(self._kept, t_ns, key=lambda kept: kept.reading.t_ns)
        if k == len(self._kept):
            return None
        b = self._kept[k]
        if b.reading.t_ns == t_ns:
            return OdomPose(t_ns, matrix(b.reading), self.epoch, b.path_m, b.turn_rad)
        if k == 0:
            return None
        a = self._kept[k - 1]
        gap_s = (b.reading.t_ns - a.reading.t_ns) * NS
        turn_rad = abs(b.reading.theta_rad - a.reading.theta_rad)
        if gap_s > LONGEST_GAP_S or turn_rad >= HALF_TURN_RAD:
            return None
        s = (t_ns - a.reading.t_ns) * NS / gap_s
        return OdomPose(
            t_ns,
            se3.interpolate(matrix(a.reading), matrix(b.reading), s),
            self.epoch,
            a.path_m + s * (b.path_m - a.path_m),
            a.turn_rad + s * (b.turn_rad - a.turn_rad),
        )

    def _news(self, datagram: Datagram, heard_ns: int) -> News:
        latest = self._latest
        if latest is None:
            return News.ANEW
        is_same = datagram.epoch == latest.epoch
        if not is_same and datagram.epoch not in self._left:
            return News.ANEW
        is_ahead = 0 < (datagram.number - latest.number) % 2**32 < 2**31
        later_ns = datagram.reckoned.t_ns - latest.reckoned.t_ns
        if is_same and is_ahead and later_ns > 0:
            is_near = self._is_drivable(latest.reckoned, datagram.reckoned)
            return News.NEXT if is_near else News.ANEW
        # It numbers anew, or its clock was set back: what is only late is behind in both.
        if is_same and (later_ns > 0 or (is_ahead and later_ns < 0)):
            return News.ANEW
        return News.ANEW if (heard_ns - self._heard_ns) * NS > LATE_S else News.OLD

    def _is_drivable(self, a: Reckoned, b: Reckoned) -> bool:
        gap_s = (b.t_ns - a.t_ns) * NS
        way_m = math.hypot(b.x_m - a.x_m, b.y_m - a.y_m)
        turn_rad = abs(b.theta_rad - a.theta_rad)
        return (
            way_m <= SLACK_M + gap_s * self.speeds.most_m_s
            and turn_rad <= SLACK_RAD + gap_s * self.speeds.most_rad_s
        )

    def _begin(self, datagram: Datagram) -> None:
        if self._latest is not None and self._latest.epoch != datagram.epoch:
            self._left.append(self._latest.epoch)
        if datagram.epoch in self._left:
            self._left.remove(datagram.epoch)
        self._kept.clear()
        self.epoch += 1

    def _keep(self, b: Reckoned) -> None:
        if not self._kept:
            self._kept.append(_Kept(b, 0.0, 0.0))
            return
        last = self._kept[-1]
        a = last.reading
        turn_rad = abs(b.theta_rad - a.theta_rad)
        way_m = arc_m(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m), turn_rad)
        self._kept.append(_Kept(b, last.path_m + way_m, last.turn_rad + turn_rad))


def matrix(reading: Reckoned) -> Array:
    """T_odom_base (4, 4) on the floor."""
    c, s = math.cos(reading.theta_rad), math.sin(reading.theta_rad)
    T = np.eye(4)
    T[:2] = [[c, -s, 0.0, reading.x_m], [s, c, 0.0, reading.y_m]]
    return T


def arc_m(chord_m: float, turn_rad: float) -> float:
    """Length of the arc over a chord, of half a turn at most."""
    half_rad = 0.5 * min(turn_rad, HALF_TURN_RAD)
    return chord_m * half_rad / math.sin(half_rad) if half_rad else chord_m
