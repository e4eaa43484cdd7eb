"""The interlock: the only way to the laser's switch, and every reason why it stays off.

A window of light has an end before it begins. The device itself ends it, so that no fault of this
program, nor its death, makes it longer; everything here can only refuse it or end it earlier.
"""

import atexit
import contextlib
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from types import FrameType, TracebackType
from typing import TypeAlias

from robot_agent.laser.device import DeviceError, LaserDevice, Steps

SECOND_NS = 1_000_000_000

Clock: TypeAlias = Callable[[], int]
Permit: TypeAlias = Callable[[int, float], bool]
"""Whether the laser may be on from `now_ns` on for so many seconds: a lease, a slot of a code."""
Direction: TypeAlias = Callable[[Steps], tuple[float, float]]
"""Bearing and elevation of the beam in base, in rad, as cam stands now; NaN where unknown."""
Mark: TypeAlias = tuple[int, int]
"""What both clocks said at one moment."""


class DeviceFailed(str):
    """Why the laser is dark: not that it may not be on, but that the device does not obey."""


DONE, TURNS, CHANGES = "done", "the mirrors turn", "the permit changes"
EXPECTED = (DONE, TURNS, CHANGES)


@dataclass(frozen=True, slots=True)
class Limits:
    """bearing_rad, elevation_rad  the allowed sector in base, from and to
    longest_s    of one window
    dwell_s      light at a stretch; in any time t the laser is on for dwell_s + refill t at most
    heartbeat_s  the agent's loop shows that often that it lives
    apart_s      by how much the two clocks may come apart while a permit lasts
    """

    bearing_rad: tuple[float, float]
    elevation_rad: tuple[float, float]
    longest_s: float = 0.3
    dwell_s: float = 1.0
    refill: float = 0.5
    heartbeat_s: float = 0.5
    apart_s: float = 0.005


class Interlock:
    """Owns the device from now on. Every method may be called from any thread; those that return
    `str | None` say why the laser is dark, None: done; DeviceFailed where the
    device does not obey. `tell` is given each reason once."""

    def __init__(
        self,
        device: LaserDevice,
        limits: Limits,
        direction: Direction,
        clock: Clock,
        second_clock: Clock,
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.__device = device
        self._limits, self._direction, self._tell = limits, direction, tell
        self._clocks = (clock, second_clock)
        self._lock = threading.RLock()
        self._stopped: str | None = None
        self._permit: Permit | None = None
        self._mark = self._beat = self.mark()
        self._aimed = False
        self._from_ns: int | None = None
        self._until_ns = 0
        self._drained, self._spent_ns = self._beat, 0.0
        # Of a device that nobody has told to be dark nothing is known.
        self._surely_dark = False
        self._said = ""

    def mark(self) -> Mark:
        return self._clocks[0](), self._clocks[1]()

    def probe(self) -> str:
        """One line about the device, whose laser is dark then. Raises DeviceError."""
        with self._lock:
            self._aimed = False
            self._darken("probed")
            return self.__device.probe()

    def beat(self) -> None:
        """The agent's loop lives."""
        with self._lock:
            self._beat = self.mark()

    def allow(self, permit: Permit | None, since: Mark) -> None:
        """`permit` holds while the clocks go together as they have since `since`, when it was
        asked for; the mirrors must be steered after it. None: no light any more."""
        with self._lock:
            self._aimed = False
            self._darken(CHANGES)
            self._permit, self._mark = permit, since

    def moved(self) -> None:
        """The scanner turned with what carries it: dark until it is steered anew."""
        with self._lock:
            self._aimed = False
            self._darken("the mount moved")

    def steer(self, steps: Steps) -> str | None:
        """Turn the mirrors, in the dark."""
        with self._lock:
            self._aimed = False
            self._darken(TURNS)
            if why := self._stopped or self._outside(steps):
                return why
            if not self._surely_dark:
                return DeviceFailed("the device did not confirm that the laser is off")
            try:
                self.__device.steer(steps)
            except DeviceError as error:
                return DeviceFailed(error)
            self._aimed = True
            return None

    def light(self, for_s: float) -> str | None:
        """On for so long from now, anew if it is on already. What goes wrong leaves it dark."""
        with self._lock:
            try:
                why = self._lit(for_s)
            except DeviceError as error:
                # It may have begun anew, with its mirrors anywhere.
                why, self._aimed = DeviceFailed(error), False
            except BaseException:
                self._darken("an exception")
                raise
            if why is not None:
                self._darken(why)
            return why

    def tired(self, for_s: float) -> str | None:
        """Why so much light in a row would end too early, None: it would not. After enough time in
        the dark any is allowed."""
        with self._lock:
            limits = self._limits
            if self._spent_s() > max(0.0, limits.dwell_s - for_s * (1.0 - limits.refill)):
                return f"{for_s:g} s more light so soon"
            return None

    def check(self) -> str | None:
        """To be called often: ends what must not go on."""
        with self._lock:
            why = self._objection(0.0)
            if self._from_ns is not None and self._clocks[0]() >= self._until_ns:
                why = why or "the window is over"
            if why is not None or self._from_ns is None:
                self._darken(why or DONE)
            return why

    def dark(self) -> None:
        with self._lock:
            self._darken(DONE)

    def is_lit(self) -> bool:
        with self._lock:
            return self.check() is None and self._from_ns is not None

    def stop(self, why: str = "stopped") -> None:
        """For good."""
        with self._lock:
            self._stopped = self._stopped or why
            self._permit = None
            self._darken(why)

    def close(self) -> None:
        self.stop("closed")
        with self._lock, contextlib.suppress(Exception):
            self.__device.close()

    def __enter__(self) -> "Interlock":
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self.close()

    def stop_with_process(self) -> None:
        """Also dark when the process ends or is told to. From the main thread; signals go on to
        whoever handled them before."""
        atexit.register(self.stop, "the process ends")
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, partial(self._signalled, signal.getsignal(number)))

    def _signalled(self, before: object, number: int, frame: FrameType | None) -> None:
        self.stop(f"signal {number}")
        if callable(before):
            before(number, frame)
        elif before is signal.SIG_DFL:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)

    def _lit(self, for_s: float) -> str | None:
        if why := self._objection(for_s):
            return why
        now_ns = self._clocks[0]()
        self._from_ns = now_ns if self._from_ns is None else self._from_ns
        self._until_ns = now_ns + round(for_s * SECOND_NS)
        try:
            self.__device.light(self._until_ns)
        finally:
            # Also where a signal has had it dark a moment ago.
            self._surely_dark = False
        # The device may have taken its time: is all this still so?
        return self._objection(0.0)

    def _objection(self, for_s: float) -> str | None:
        """Why there must be no light now, nor for `for_s` from now on."""
        limits = self._limits
        if self._stopped:
            return self._stopped
        if self._is_apart(self._mark):
            self._permit = None
            return "a clock jumped, or the robot slept"
        if self._permit is None:
            return "nobody allowed it"
        now_ns = self._clocks[0]()
        if not 0.0 <= for_s <= limits.longest_s:
            return f"a window of {for_s:g} s, expected at most {limits.longest_s:g} s"
        if not self._permit(now_ns, for_s):
            return "the permit is over, or too short"
        if self._is_apart(self._beat) or self._since_s(self._beat) + for_s > limits.heartbeat_s:
            return f"no heartbeat within {limits.heartbeat_s:g} s"
        if not self._aimed:
            return "the mirrors were not steered"
        if self._from_ns is None and not self._surely_dark:
            return DeviceFailed("the device did not confirm that the laser is off")
        if self._spent_s() + for_s * (1.0 - limits.refill) > limits.dwell_s:
            return f"on for {limits.dwell_s:g} s at a stretch"
        return None

    def _is_apart(self, mark: Mark) -> bool:
        first, second = (now - then for now, then in zip(self.mark(), mark, strict=True))
        apart_s = abs(first - second) / SECOND_NS
        return min(first, second) < 0 or apart_s > self._limits.apart_s

    def _since_s(self, mark: Mark) -> float:
        return (self._clocks[0]() - mark[0]) / SECOND_NS

    def _spent_s(self) -> float:
        """A bucket that light fills and time drains; of two clocks the one that is worse for us."""
        now = self.mark()
        passed = [max(0, at - then) for at, then in zip(now, self._drained, strict=True)]
        lit_ns = 0 if self._from_ns is None else max(passed)
        self._spent_ns = max(0.0, self._spent_ns + lit_ns - self._limits.refill * min(passed))
        self._drained = now
        return self._spent_ns / SECOND_NS

    def _outside(self, steps: Steps) -> str | None:
        bearing, elevation = self._direction(steps)
        for name, angle, (least, most) in (
            ("bearing", bearing, self._limits.bearing_rad),
            ("elevation", elevation, self._limits.elevation_rad),
        ):
            if not least <= angle <= most:
                return f"{name} {angle:.3f} rad, allowed are {least:.3f} to {most:.3f} rad"
        return None

    def _darken(self, why: str) -> None:
        """Until the device confirms, this is tried again by every call."""
        was_lit = self._from_ns is not None
        if not was_lit and self._surely_dark:
            return
        self._spent_s()
        self._from_ns, self._surely_dark = None, False
        try:
            self.__device.dark()
            self._surely_dark = True
        except Exception as error:
            if was_lit:
                self._spent_ns += max(0, self._until_ns - self._clocks[0]())
            self._say(f"the laser may be on until its window ends: {error}")
        if was_lit and why not in EXPECTED:
            self._say(f"laser off: {why}")

    def _say(self, what: str) -> None:
        if what != self._said:
            self._said = what
            self._tell(what)
