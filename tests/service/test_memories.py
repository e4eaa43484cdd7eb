"""Write-back over the real link: two robots, blank tags, and a service that is killed between a
write and its answer."""

import time
from dataclasses import dataclass, field

import pytest
from msgspec.structs import replace

from tagmap.errors import RecordRefused
from tagmap.memory.provenance import is_prior
from tagmap.memory.slots import read
from tagmap.memory.writing import compare, plan_write
from tagmap.records import JobResult, WriteJob, decode, encode
from tests.mapping.messages import hello
from tests.mapping.world import TAGS, drive
from tests.service.conftest import Client

SITE_NUMBER = 3
PATIENCE_S = 60.0
SURVEYED = ("1", "2", "3")


@dataclass
class Robot:
    """What it reads in the tags goes along with what it sees."""

    client: Client
    number: int
    seq: int = 0
    done: set[int] = field(default_factory=set)

    @property
    def name(self):
        return self.client.robot

    def hello(self):
        return hello(self.name, self.number, f"session-{self.name}")

    def step(self, memories):
        self.seq += 1
        seen = drive(self.seq, robot=self.name, session=f"session-{self.name}")
        sightings = tuple(replace(s, memory=memories[s.tag]) for s in seen.sightings)
        return replace(seen, sightings=sightings)

    def jobs(self):
        key = self.client.keys.jobs(self.name)
        jobs = [decode(WriteJob, payload) for where, payload in self.client.heard if where == key]
        return [job for job in jobs if job.job not in self.done]

    def write(self, job, memories):
        """The answer to be sent."""
        self.done.add(job.job)
        outcome, reason = "written", None
        try:
            plan = plan_write(memories[job.tag], job.record, job.tag, site=SITE_NUMBER)
        except RecordRefused as error:
            plan, outcome, reason = None, "failed", error.reason
        if plan is not None:
            memory, first = memories[job.tag], 2 * plan.first_word
            memories[job.tag] = memory[:first] + plan.data + memory[first + len(plan.data) :]
            assert compare(plan, memories[job.tag]) is None
        told = {"outcome": outcome, "reason": reason, "read": memories[job.tag]}
        return JobResult(robot=self.name, job=job.job, tag=job.tag, **told)

    def tell(self, result):
        self.client.link.put(self.client.keys.job_results(self.name), encode(result))


@pytest.fixture
def robots(serve):
    """Of a service that writes memories, on a map that is anchored; all memories are blank."""
    serve.start("--site-number", str(SITE_NUMBER))
    robots = [Robot(Client(serve.endpoint, name), n + 1) for n, name in enumerate(("r1", "r2"))]
    admin = robots[0].client
    for tag in SURVEYED:
        x_m, y_m = map(float, TAGS[tag])
        admin.admin("tags", "survey", tag=tag, x_m=x_m, y_m=y_m, z_m=0.0, sigma_m=1e-3)
    blank = dict.fromkeys(TAGS, bytes(88))
    for robot in robots:
        robot.client.link.declare_alive(robot.client.keys.alive(robot.name))
        robot.client.deliver(robot.hello(), *(robot.step(blank) for _ in range(20)))
    admin.admin("map", "solve")
    yield robots
    for robot in robots:
        robot.client.link.close()


def states(robots):
    tags = robots[0].client.admin("tags", "memory")["tags"]
    return {tag["tag"]: tag["state"] for tag in tags}


def work_until(robots, memories, is_over, answers=True):
    """Look at the tags twice a second, and carry out whatever jobs come."""
    give_up_s = time.monotonic() + PATIENCE_S
    while not is_over():
        assert time.monotonic() < give_up_s, states(robots)
        for robot in robots:
            robot.client.send(robot.step(memories))
            for job in robot.jobs():
                result = robot.write(job, memories)
                if answers:
                    robot.tell(result)
        time.sleep(0.5)


def test_every_tag_ends_verified(serve, robots):
    assert set(states(robots).values()) <= {"waiting", "pending"}
    memories = dict.fromkeys(TAGS, bytes(88))
    # Looking at a tag tells its memory too: until the service is dead they look at blank ones.
    blank = dict(memories)
    give_up_s = time.monotonic() + PATIENCE_S
    while not any(robot.done for robot in robots):
        assert time.monotonic() < give_up_s
        for robot in robots:
            robot.client.send(robot.step(blank))
            for job in robot.jobs():
                robot.write(job, memories)
        time.sleep(0.2)
    serve.kill()
    written = {tag: memory for tag, memory in memories.items() if memory != blank[tag]}
    assert written
    serve.start("--site-number", str(SITE_NUMBER))
    for robot in robots:
        robot.client.deliver(robot.hello())
    work_until(robots, memories, lambda: set(states(robots).values()) == {"verified"})
    for tag, memory in memories.items():
        record = read(memory, tag, site=SITE_NUMBER).record
        assert record.p_m[:2] == pytest.approx(tuple(TAGS[tag]), abs=0.02)
        assert record.p_m[2] == 0.0
        assert is_prior(record) == (tag in SURVEYED)
    for tag, memory in written.items():
        assert memories[tag] == memory
    assert serve.stop() == 0


def test_jobs_can_be_asked_for_and_wrong_answers_are_refused(serve, robots):
    first, _ = robots
    blank = dict.fromkeys(TAGS, bytes(88))
    give_up_s = time.monotonic() + PATIENCE_S
    while not first.jobs():
        assert time.monotonic() < give_up_s
        first.client.send(first.step(blank))
        time.sleep(0.2)
    job = first.jobs()[0]
    (reply,) = first.client.ask(first.client.keys.jobs("r1"))
    again = decode(WriteJob, reply.payload)
    assert (again.job, again.tag, again.record) == (job.job, job.tag, job.record)
    assert again.valid_s < job.valid_s
    (reply,) = first.client.ask(first.client.keys.jobs("r9"))
    assert reply.error == "no job for this robot"
    result = first.write(job, dict(blank))
    first.client.link.put(first.client.keys.job_results("r1"), b"\xc1")
    first.tell(replace(result, robot="r2"))
    first.tell(replace(result, outcome="failed", read=None, reason="out of reach"))
    while state_of(first, job.tag) == ("pending", None):
        assert time.monotonic() < give_up_s
        time.sleep(0.1)
    assert state_of(first, job.tag)[1] == "out of reach"
    log = serve.log.read_text()
    assert log.count("job result refused") == 2


def state_of(robot, tag):
    tags = robot.client.admin("tags", "memory")["tags"]
    return next((one["state"], one["reason"]) for one in tags if one["tag"] == tag)
