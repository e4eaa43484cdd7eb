"""Robots, a service and a network that does what networks do, in virtual time.

Every clock goes wrong by up to the drift that the rules allow. Messages are late, lost, doubled
and overtake each other; robots and the service die at any moment and begin anew. What each robot
may do is read off its own `Holder`, where the robots are, only the world knows.
"""

import heapq
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from tagmap.arbitration.arbiter import Arbiter
from tagmap.arbitration.holder import Holder
from tagmap.arbitration.rules import SECOND_NS, Rules, Station

UTC = 1_770_000_000 * SECOND_NS
TICK_S = 0.04
ANSWER_S = 0.6


@dataclass(frozen=True)
class Faults:
    """Probabilities per message, or per tick of a robot or of the service."""

    lost: float = 0.05
    doubled: float = 0.1
    late: float = 0.2
    robot_dies: float = 0.002
    service_dies: float = 0.004
    unknown: float = 0.1


NONE = Faults(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass
class Clock:
    rate: float
    offset_ns: int

    def at(self, t_ns):
        return self.offset_ns + round(self.rate * t_ns)


@dataclass
class Robot:
    name: str
    clock: Clock
    p_m: np.ndarray
    v_mps: np.ndarray
    reader_range_m: float
    holder: Holder
    life: int = 0
    wants_since_ns: int | None = None
    longest_wait_ns: int = 0
    leases: int = 0


@dataclass
class World:
    rules: Rules
    seed: int
    n_robots: int = 5
    hall_m: float = 300.0
    faults: Faults = field(default_factory=Faults)
    begin: Callable[[Rules, int, int], Arbiter] = Arbiter.start

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)
        self.t_ns, self.events, self.order = 0, [], itertools.count()
        self.violations = []
        self.robots = {f"r{i}": self._robot(f"r{i}") for i in range(self.n_robots)}
        self._start_service()
        for robot in self.robots.values():
            self._after(self.rng.uniform(0.0, TICK_S), self._tick, robot)
        self._after(TICK_S, self._tick_service)

    def run(self, s):
        end_ns = self.t_ns + round(s * SECOND_NS)
        while self.events and self.events[0][0] <= end_ns:
            t_ns, _, act, arguments = heapq.heappop(self.events)
            self._move((t_ns - self.t_ns) / SECOND_NS)
            self.t_ns = t_ns
            act(*arguments)
            self._look()
        return self

    def _robot(self, name):
        clock = self._clock()
        p_m, reach = self.rng.uniform(0.0, self.hall_m, 3), self.rng.choice([20.0, 85.0])
        return Robot(name, clock, p_m, np.zeros(3), reach, Holder(self.rules))

    def _clock(self):
        rate = 1.0 + self.rules.drift * self.rng.choice([-1.0, 1.0, self.rng.uniform(-1.0, 1.0)])
        return Clock(rate, int(self.rng.integers(0, 10**15)))

    def _after(self, s, act, *arguments):
        event = (self.t_ns + round(s * SECOND_NS), next(self.order), act, arguments)
        heapq.heappush(self.events, event)

    def _move(self, s):
        """At full speed, turning at random; walls do not matter."""
        for robot in self.robots.values():
            robot.p_m = robot.p_m + robot.v_mps * s

    def _look(self):
        """The promise itself: no tag that one lights is heard by another that may shoot too."""
        shooting = [r for r in self.robots.values() if r.holder.may_shoot(r.clock.at(self.t_ns))]
        for a, b in itertools.combinations(shooting, 2):
            reach_m = max(a.reader_range_m, b.reader_range_m) + self.rules.laser_range_m
            apart_m = math.dist(a.p_m, b.p_m)
            if apart_m <= reach_m:
                self.violations.append((self.t_ns, a.name, b.name, apart_m))

    def _tick(self, robot):
        now_ns = robot.clock.at(self.t_ns)
        if self.rng.random() < self.faults.robot_dies:
            robot.holder, robot.life = Holder(self.rules), robot.life + 1
        if self.rng.random() < 0.05:
            direction = self.rng.normal(size=3)
            robot.v_mps = self.rules.speed_mps * direction / np.linalg.norm(direction)
        self._act(robot, now_ns)
        self._after(self.rng.uniform(0.5, 1.5) * TICK_S, self._tick, robot)

    def _act(self, robot, now_ns):
        holder = robot.holder
        if holder.lease is not None:
            if self.rng.random() < 0.1 or not holder.may_shoot(now_ns):
                self._send(self._hear_done, robot.name, holder.finish(now_ns))
        elif holder.asked_ns is not None:
            if now_ns - holder.asked_ns > ANSWER_S * SECOND_NS:
                holder.give_up(now_ns)
        elif holder.may_ask(now_ns):
            if robot.wants_since_ns is None:
                robot.wants_since_ns = self.t_ns
            question = (robot.life, holder.ask(now_ns), self._station(robot))
            self._send(self._hear_question, robot.name, *question)

    def _station(self, robot):
        if self.rng.random() < self.faults.unknown:
            return Station(None, 0.0, robot.reader_range_m)
        radius_m = self.rng.uniform(0.0, 1.0)
        error = self.rng.normal(size=3)
        p_m = robot.p_m + radius_m * error / np.linalg.norm(error)
        return Station(tuple(p_m.tolist()), radius_m, robot.reader_range_m)

    def _send(self, act, *arguments):
        if self.rng.random() < self.faults.lost:
            return
        for _ in range(2 if self.rng.random() < self.faults.doubled else 1):
            is_late = self.rng.random() < self.faults.late
            self._after(self.rng.uniform(0.001, 4.0 if is_late else 0.02), act, *arguments)

    def _start_service(self):
        self.service_clock = self._clock()
        now_ns = self.service_clock.at(self.t_ns)
        self.arbiter = self.begin(self.rules, now_ns, UTC + self.t_ns)

    def _tick_service(self):
        down_s = TICK_S
        if self.arbiter is None:
            self._start_service()
        elif self.rng.random() < self.faults.service_dies:
            self.arbiter, down_s = None, self.rng.uniform(0.0, 1.0)
        self._after(down_s, self._tick_service)

    def _hear_question(self, name, life, ticket, station):
        if self.arbiter is not None:
            now_ns, wanted_s = self.service_clock.at(self.t_ns), self.rng.uniform(0.2, 3.0)
            answer = self.arbiter.ask(name, wanted_s, station, now_ns, UTC + self.t_ns)
            self._send(self._hear_answer, name, life, ticket, answer)

    def _hear_done(self, name, lease):
        if self.arbiter is not None and lease is not None:
            now_ns = self.service_clock.at(self.t_ns)
            self.arbiter.give_back(name, lease, now_ns, UTC + self.t_ns)

    def _hear_answer(self, name, life, ticket, answer):
        robot = self.robots[name]
        if life != robot.life:
            return
        now_ns = robot.clock.at(self.t_ns)
        robot.holder.take(ticket, answer.lease, answer.valid_s, answer.retry_s, now_ns)
        if robot.holder.lease is not None and robot.wants_since_ns is not None:
            robot.longest_wait_ns = max(robot.longest_wait_ns, self.t_ns - robot.wants_since_ns)
            robot.wants_since_ns = None
            robot.leases += 1
