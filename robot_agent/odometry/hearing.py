"""What is heard of a base controller and what follows from it. Time is passed in: `now_ns` of a
clock that only goes forward, `utc_ns` of the one that readings are stamped by."""

from collections import deque
from dataclasses import dataclass, field

from robot_agent.odometry.datagram import MAGIC, BadDatagram, Datagram, decode
from robot_agent.odometry.odometry import Reason
from robot_agent.odometry.still import Still
from robot_agent.odometry.track import News, OdometryTrack

NS = 1e-9
RATED = 256


@dataclass(slots=True)
class Counts:
    """Datagrams: readings; old ones, late or twice; malformed ones; foreign ones, from elsewhere or
    of another kind."""

    readings: int = 0
    old: int = 0
    malformed: int = 0
    foreign: int = 0


@dataclass(slots=True)
class Hearing:
    """`sender`: the address that alone is believed. Began at `heard_ns`, of the clock that only
    goes forward."""

    track: OdometryTrack
    still: Still
    stale_s: float
    sender: str | None
    heard_ns: int
    counts: Counts = field(default_factory=Counts)
    latest_ns: int = 0
    _ahead_s: float = 0.0
    _unread: str | None = None
    _heard: deque[int] = field(default_factory=lambda: deque(maxlen=RATED))

    def hear(self, data: bytes, sender: str, now_ns: int, utc_ns: int) -> bool:
        """True: that the robot stands is over."""
        is_over = self.miss(now_ns)
        datagram = self._read(data, sender)
        if datagram is None:
            return is_over
        news = self.track.add(datagram, now_ns)
        if news is News.OLD:
            self.counts.old += 1
            return is_over
        self.counts.readings += 1
        if self._is_silent(now_ns):
            self._heard.clear()
        self.heard_ns, self._unread = now_ns, None
        self._heard.append(now_ns)
        reading = datagram.reckoned
        self.latest_ns, self._ahead_s = reading.t_ns, (reading.t_ns - utc_ns) * NS
        if news is News.ANEW:
            is_over |= self.still.forget()
        is_over |= self.still.add(reading)
        if abs(self._ahead_s) > self.stale_s:
            is_over |= self.still.forget()
        return is_over

    def miss(self, now_ns: int) -> bool:
        """Time has passed. True: that the robot stands is over, for it is not known any more."""
        return self._is_silent(now_ns) and self.still.forget()

    def still_since_ns(self, now_ns: int, utc_ns: int) -> int | None:
        is_of_now = abs(utc_ns - self.latest_ns) * NS <= self.stale_s
        return self.still.since_ns if is_of_now and not self._is_silent(now_ns) else None

    def rate_hz(self, least_s: float) -> float | None:
        """Of the latest readings; None while they span less than `least_s`."""
        span_s = (self._heard[-1] - self._heard[0]) * NS if self._heard else 0.0
        return (len(self._heard) - 1) / span_s if span_s > least_s else None

    def wrong(self, now_ns: int) -> tuple[Reason, str] | None:
        """Why there are no new readings to trust, and in words."""
        if self._is_silent(now_ns):
            if self._unread is not None:
                return "unreadable", f"no reading is what comes: {self._unread}"
            return "silent", f"no reading for {(now_ns - self.heard_ns) * NS:.1f} s"
        if abs(self._ahead_s) > self.stale_s:
            side = "ahead of" if self._ahead_s > 0.0 else "behind"
            by_s = f"{abs(self._ahead_s):.2f} s"
            return "clock_off", f"times of readings are {by_s} {side} the clock when they come"
        return None

    def _is_silent(self, now_ns: int) -> bool:
        return (now_ns - self.heard_ns) * NS > self.stale_s

    def _read(self, data: bytes, sender: str) -> Datagram | None:
        if self.sender not in (None, sender):
            self.counts.foreign += 1
            self._unread = f"from {sender}, expected {self.sender}"
            return None
        try:
            return decode(data)
        except BadDatagram as error:
            if data.startswith(MAGIC):
                self.counts.malformed += 1
            else:
                self.counts.foreign += 1
            self._unread = str(error)
            return None
