"""A laser in true time, whose every fault happens, and an oracle that knows when it may be on.

The robot sees two clocks, of which one in each run may jump. The device has a clock of its own and
ends every window by it; its answers tell what that clock says, as those of a real one do.
"""

from dataclasses import dataclass, field

from robot_agent.laser.device import DeviceError
from robot_agent.laser.interlock import SECOND_NS, Interlock, Limits

LIMITS = Limits((-0.5, 0.5), (-0.2, 0.6), longest_s=0.3, dwell_s=0.2, refill=0.3)
STEP_RAD = 0.01
APART_NS = round(LIMITS.apart_s * SECOND_NS)


class Killed(BaseException):
    """The process is gone: nothing it would have done any more happens."""


def direction(steps):
    return STEP_RAD * steps[0], STEP_RAD * steps[1]


@dataclass
class Lit:
    from_ns: int
    to_ns: int
    steps: tuple[int, int]


@dataclass
class World:
    rng: object
    t_ns: int = 10**12
    jumped: list[int] = field(default_factory=lambda: [0, 7 * 10**12])
    jumping: int = 0
    permit_ends_ns: int = 0
    beat_ns: int = 10**12

    @property
    def allowed_ns(self):
        """Until when, in true time, light may last by what is known now."""
        return min(self.beat_ns + round(LIMITS.heartbeat_s * SECOND_NS), self.permit_ends_ns)

    def clock(self):
        return self.t_ns + self.jumped[0]

    def second_clock(self):
        return self.t_ns + self.jumped[1]

    def passes(self, s):
        self.t_ns += round(s * SECOND_NS)


class FaultyLaser:
    def __init__(self, world, faulty):
        self.world, self.faulty = world, faulty
        self.steps = (0, 0)
        self.until_ns = self.told_ns = self.came_ns = 0
        self.on: Lit | None = None
        self.beyond: list[int] = []
        self.record: list[Lit] = []
        self.lights = self.steered_lit = 0

    def is_on(self):
        self._end()
        return self.on is not None

    def probe(self):
        return "faulty"

    def steer(self, steps):
        self._call(lambda: self._steer(steps))
        self._told()

    def light(self, until_ns):
        self.lights += 1
        until_ns = self.told_ns + until_ns - self.came_ns
        self._call(lambda: self._on(until_ns))
        self._told()

    def dark(self):
        self._call(self._off)
        self._told()

    def close(self):
        self.dark()

    def _call(self, act):
        """The order takes its time, is lost, is obeyed without an answer, or breaks the program."""
        rng, self._answered = self.world.rng, False
        fault = rng.random() if self.faulty else 1.0
        if fault < 0.04:
            raise DeviceError("no answer")
        if fault < 0.08:
            self.world.passes(rng.random() * 0.2)
        self._end()
        if fault < 0.1:
            self.world.jumped[self.world.jumping] += rng.randint(-(10**9), 10**9)
        act()
        if fault < 0.11:
            raise Killed
        if fault < 0.13:
            raise ZeroDivisionError("a bug")
        if fault < 0.16:
            raise DeviceError("no answer, though obeyed")
        if fault < 0.2:
            self.world.passes(rng.random() * 0.1)

    def _told(self):
        self.told_ns, self.came_ns = self.world.t_ns, self.world.clock()

    def _steer(self, steps):
        self.steered_lit += self.on is not None
        self.steps = steps

    def _on(self, until_ns):
        if until_ns <= self.world.t_ns:
            return
        if until_ns > self.world.allowed_ns + APART_NS:
            self.beyond.append(until_ns - self.world.allowed_ns)
        if self.on is None:
            self.on = Lit(self.world.t_ns, 0, self.steps)
        self.until_ns = until_ns

    def _off(self):
        self._end()
        if self.on is not None:
            self._close(self.world.t_ns)

    def _end(self):
        if self.on is not None and self.world.t_ns >= self.until_ns:
            self._close(self.until_ns)

    def _close(self, t_ns):
        self.record.append(Lit(self.on.from_ns, t_ns, self.on.steps))
        self.on = None


def interlock_on(world, device):
    return Interlock(device, LIMITS, direction, world.clock, world.second_clock)
