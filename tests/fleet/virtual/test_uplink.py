"""What a robot has of the service in virtual time: leases, jobs, the map."""

import pytest
from msgspec.structs import replace

from fleet.virtual.bus import Bus
from fleet.virtual.operator import Operator
from fleet.virtual.site import Kill, VirtualSite
from fleet.virtual.uplink import VirtualUplink
from fleet.virtual.virtual_time import VirtualTime
from robot_agent.flight import Parcel
from tagmap.arbitration.rules import Rules
from tagmap.mapping.surveying import SurveyedPosition
from tagmap.records import JobResult, LeaseRequest, encode
from tagmap.writeback.wanted import Owner
from tests.fleet.virtual.conftest import SECOND_NS, START_NS
from tests.mapping.messages import SESSION, hello
from tests.mapping.world import TAGS, drive

RULES = Rules()
WANTED = LeaseRequest(robot="r1", wanted_s=RULES.max_lease_s)


@pytest.fixture
def world(tmp_path, compiled_solver):  # noqa: ARG001
    return World(tmp_path)


class World:
    """A site, and one robot that talks to it."""

    def __init__(self, folder, **options):
        self.time = VirtualTime(START_NS)
        self.bus = Bus(self.time, 1)
        surveys = [SurveyedPosition(t, (*map(float, TAGS[t]), 0.0), 1e-3) for t in ("1", "2", "3")]
        self.site = VirtualSite(folder, self.time, self.bus, surveys=surveys, **options)
        self.keys = self.site.keys
        self.uplink = VirtualUplink(self.bus.port("r1"), self.keys, "r1", senses=True)

    def run(self, live):
        def started():
            self.uplink.start()
            live()

        self.site.run([started])

    def send(self, *messages):
        self.uplink.send([Parcel(SESSION, m.seq, encode(m)) for m in messages])

    def settled(self, last):
        """Wait for the acknowledgement."""
        self.until(lambda: any(ack.contiguous >= last for ack in self.uplink.take(0.1)))

    def until(self, over, patience_s=30.0):
        until_ns = self.time.now_ns() + round(patience_s * SECOND_NS)
        while not over():
            assert self.time.now_ns() < until_ns
            self.time.wait_ns(SECOND_NS // 100)

    def lease(self):
        """The first one, and when it was granted."""
        while True:
            reply = self.uplink.lease(WANTED, 0.5)
            if reply is not None and reply.lease is not None:
                return reply.lease
            self.time.wait_ns(SECOND_NS // 10)


def test_leases_come_from_the_service_after_one_of_silence(world):
    leases = []

    def live():
        assert world.uplink.lease(WANTED, 0.5) is None
        world.send(hello())
        world.settled(0)
        leases.append(world.lease())

    world.run(live)
    silence_ns = round(RULES.withheld_s(RULES.max_lease_s) * SECOND_NS)
    assert START_NS + silence_ns <= leases[0] < START_NS + silence_ns + SECOND_NS // 2


def test_a_restarted_service_is_silent_again(tmp_path):
    killed_ns = START_NS + 5 * SECOND_NS
    world, leases = World(tmp_path, kills=[Kill(killed_ns, down_s=1.0)]), []

    def live():
        world.send(hello())
        world.settled(0)
        leases.append(world.lease())
        world.time.wait_until(killed_ns)
        leases.append(world.lease())

    world.run(live)
    assert world.site.starts == 2
    assert leases[1] >= killed_ns + SECOND_NS + RULES.withheld_s(RULES.max_lease_s) * SECOND_NS


def test_nobody_answers_in_time_while_the_way_is_cut(world):
    def live():
        world.bus.cut("r1")
        began_ns = world.time.now_ns()
        assert world.uplink.lease(WANTED, 0.5) is None
        assert world.time.now_ns() == began_ns + SECOND_NS // 2
        assert world.uplink.connected()
        world.time.wait_ns(3 * SECOND_NS)
        assert not world.uplink.connected()

    world.run(live)


def test_the_map_comes_by_itself(world):
    maps = []

    def live():
        assert world.uplink.served() is None
        world.send(hello(), *(drive(seq) for seq in range(1, 31)))
        world.settled(30)

        def came():
            world.uplink.take(0.1)
            served = world.uplink.served()
            if served is not None:
                maps.append(served)
            return bool(maps)

        world.until(came)

    world.run(live)
    assert [tag.tag for tag in maps[0].tags] == ["1", "2", "3", "4"]
    assert maps[0].version.gauge == "anchored"
    assert maps[0].site == "site"


def test_an_operator_asks_and_is_answered(world):
    states = []

    def live():
        world.send(hello(), drive(1), drive(2))
        world.settled(2)
        states.append(Operator(world.bus, world.keys).ask("site", "status"))

    world.run(live)
    assert (states[0]["keyframes"], states[0]["alive"]) == (2, 1)


def test_jobs_come_and_their_results_are_heard(tmp_path, compiled_solver):  # noqa: ARG001
    """Blank memories of mapped tags that a robot sees are to be written."""
    world = World(tmp_path, owner=Owner(3))
    jobs, states = [], []

    def seen(seq):
        keyframe = drive(seq)
        sightings = tuple(replace(s, memory=bytes(88)) for s in keyframe.sightings)
        return replace(keyframe, sightings=sightings)

    def live():
        operator = Operator(world.bus, world.keys)
        world.send(hello(), *(seen(seq) for seq in range(1, 21)))
        world.settled(20)
        operator.ask("map", "solve")
        for seq in range(21, 41):
            world.send(seen(seq))
            world.time.wait_ns(SECOND_NS // 2)
            world.uplink.take(0.0)
            jobs.extend(world.uplink.jobs())
            if jobs:
                break
        told = {"job": jobs[0].job, "tag": jobs[0].tag, "read": None, "reason": "too far"}
        world.uplink.publish_result(JobResult(robot="r1", outcome="failed", **told))
        world.time.wait_ns(SECOND_NS)
        states.extend(operator.ask("tags", "memory")["tags"])

    world.run(live)
    assert jobs[0].tag in TAGS
    answered = next(state for state in states if state["tag"] == jobs[0].tag)
    assert answered["reason"] == "too far"
