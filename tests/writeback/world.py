"""Tags, robots that write them, a service that dies and a network that loses, in virtual time."""

import heapq
import itertools
import random
from dataclasses import dataclass

from tagmap.errors import RecordRefused
from tagmap.memory.slots import read
from tagmap.memory.writing import plan_write
from tagmap.records import JobResult, decode, encode
from tagmap.writeback.planner import SECOND_NS, Planner, Rules, Seer
from tagmap.writeback.wanted import Owner, Wanted

OWNER = Owner(site=3)
RULES = Rules(valid_s=10.0, grace_s=1.0, pause_s=2.0, most_s=60.0)
UTC = 1_770_000_000 * SECOND_NS


def wanted(x_m=1.0, version=1, sigma_m=0.002, **fields):
    variance = sigma_m * sigma_m
    return Wanted(
        p_m=(x_m, 2.0, 3.0),
        cov=(variance, 0.0, 0.0, variance, 0.0, variance),
        map_version=version,
        t_s=1_770_000_000 + version,
        count=9,
        **fields,
    )


@dataclass(frozen=True)
class Faults:
    lost: float = 0.1
    doubled: float = 0.1
    robot_dies: float = 0.1
    service_dies: float = 0.02
    deaf: float = 0.1


NONE = Faults(0.0, 0.0, 0.0, 0.0, 0.0)


class World:
    """`read_before`: what the service has stored of memories, in order: all that it knows after
    a restart. `writes`: how often each tag's memory was really written to."""

    def __init__(self, seed, n_tags=5, n_robots=3, faults=None):
        self.rng = random.Random(seed)
        self.faults = faults or Faults()
        sizes = (88, 88, 128, 32, 44)
        self.memories = {f"e2{i:06x}": bytes(sizes[i % len(sizes)]) for i in range(n_tags)}
        self.robots = [f"r{i}" for i in range(n_robots)]
        self.done = {robot: {} for robot in self.robots}
        self.writes = dict.fromkeys(self.memories, 0)
        self.map = {tag: wanted(float(i)) for i, tag in enumerate(self.memories)}
        self.read_before, self.orders = [], []
        self.t_ns, self.events, self.order = 0, [], itertools.count()
        self._start()
        for tag, memory in self.memories.items():
            self._store(tag, memory)
        self._after(0.0, self._tick)

    def run(self, s):
        end_ns = self.t_ns + round(s * SECOND_NS)
        while self.events[0][0] <= end_ns:
            self.t_ns, _, act, arguments = heapq.heappop(self.events)
            act(*arguments)
        self.t_ns = end_ns
        return self

    def holds(self, tag):
        record = read(self.memories[tag], tag, site=OWNER.site).record
        return None if record is None else record.map_version

    def states(self):
        return {state.tag: state.state for state in self.planner.states(self.t_ns)}

    def move(self, tag, x_m):
        before = self.map[tag]
        self.map[tag] = wanted(x_m, before.map_version + 1)
        self.planner.wanted = self.map

    def _start(self):
        """What is out is forgotten; what was stored is not."""
        self.planner = Planner(OWNER, RULES)
        self.planner.wanted = self.map
        for tag, memory, job in self.read_before:
            self.planner.heard(tag, memory, job)

    def _store(self, tag, memory, job=None):
        self.read_before.append((tag, memory, job))
        self.planner.heard(tag, memory, job)

    def _tick(self):
        if self.rng.random() < self.faults.service_dies:
            self._start()
        seen = {tag: self._seers() for tag in self.memories}
        for order in self.planner.plan(seen, self.t_ns, UTC + self.t_ns):
            seers = {seer.robot: seer for seer in seen[order.job.tag]}
            assert seers[order.robot].distance_m <= RULES.range_m
            self.orders.append(order)
            self._send(0.5, self._work, order.robot, encode(order.job))
        out = [self.planner.job_of(robot, self.t_ns) for robot in self.robots]
        tags = [job.tag for job in out if job is not None]
        assert len(set(tags)) == len(tags)
        self._after(0.5, self._tick)

    def _seers(self):
        """Each robot sees each tag now and then, some from too far away."""
        return [
            Seer(robot, n + 1, self.rng.uniform(1.0, 40.0))
            for n, robot in enumerate(self.robots)
            if self.rng.random() < 0.7
        ]

    def _work(self, robot, payload):
        """As an agent does: light it, read, plan, write, read back, answer. Once for each job."""
        job = decode(type(self.orders[0].job), payload)
        if self.rng.random() < self.faults.deaf:
            return
        if job.job not in self.done[robot]:
            result = self._carry_out(robot, job)
            if result is None:
                return
            self.done[robot][job.job] = result
        self._send(1.0, self._answer, robot, encode(self.done[robot][job.job]))

    def _carry_out(self, robot, job):
        """None where the robot died over it, at any byte."""
        tag, memory = job.tag, self.memories[job.tag]
        try:
            plan = plan_write(memory, job.record, tag, site=OWNER.site)
        except RecordRefused as error:
            fields = {"outcome": "failed", "read": memory, "reason": error.reason}
            return JobResult(robot=robot, job=job.job, tag=tag, **fields)
        if plan is not None:
            dies = self.rng.random() < self.faults.robot_dies
            data = plan.data[: self.rng.randrange(len(plan.data)) if dies else None]
            first = 2 * plan.first_word
            self.memories[tag] = memory[:first] + data + memory[first + len(data) :]
            self.writes[tag] += 1
            if dies:
                return None
        return JobResult(
            robot=robot, job=job.job, tag=tag, outcome="written", read=self.memories[tag]
        )

    def _answer(self, robot, payload):
        result = decode(JobResult, payload)
        job = result.job if result.outcome == "written" else None
        self.read_before.append((result.tag, result.read, job))
        self.planner.answer(robot, result, self.t_ns)

    def _send(self, slowest_s, act, *arguments):
        if self.rng.random() >= self.faults.lost:
            for _ in range(2 if self.rng.random() < self.faults.doubled else 1):
                self._after(self.rng.uniform(0.01, slowest_s), act, *arguments)

    def _after(self, s, act, *arguments):
        event = (self.t_ns + round(s * SECOND_NS), next(self.order), act, arguments)
        heapq.heappush(self.events, event)
