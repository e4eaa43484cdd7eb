"""Who writes which tag when, step by step and over random schedules."""

import itertools

import pytest
from msgspec.structs import replace

from tagmap.memory.slots import encode_for, read
from tagmap.records import JobResult
from tagmap.writeback.planner import SECOND_NS, Planner, Seer
from tests.writeback.world import NONE, OWNER, RULES, UTC, Faults, World, wanted

TAG = "e2000000"
NEAR, AWAY = Seer("r1", 1, 3.0), Seer("r2", 2, 29.0)


def planner(memory=bytes(88), **fields):
    one = Planner(OWNER, RULES)
    one.wanted = {TAG: wanted(**fields)}
    if memory is not None:
        one.heard(TAG, memory)
    return one


def memory_with(one):
    return encode_for(88, one.record(OWNER, 1), TAG).ljust(88, b"\0")


def plan(one, *seers, s=0.0):
    now_ns = round(s * SECOND_NS)
    return one.plan({TAG: seers}, now_ns, UTC + now_ns)


def result(order, read, outcome="written", **fields):
    robot, job = fields.pop("robot", order.robot), order.job
    return JobResult(robot=robot, job=job.job, tag=job.tag, outcome=outcome, read=read, **fields)


def state(one, s=0.0):
    (only,) = one.states(round(s * SECOND_NS))
    return only


def test_from_blank_to_verified():
    one = planner()
    (order,) = plan(one, AWAY, NEAR)
    assert (order.robot, order.job.tag, order.job.valid_s) == ("r1", TAG, RULES.valid_s)
    assert state(one).state == "pending"
    memory = order.job.record.ljust(88, b"\0")
    told = read(memory, TAG).record
    assert (told.robot, told.site, told.map_version) == (1, OWNER.site, 1)
    one.answer("r1", result(order, memory), 0)
    assert (state(one).state, state(one).writes) == ("verified", 1)
    assert plan(one, NEAR) == []
    one.answer("r1", result(order, memory), 0)
    assert state(one).writes == 1


def test_nobody_writes_what_nobody_has_read():
    one = planner(memory=None)
    assert plan(one, NEAR) == []
    assert state(one).state == "unread"


@pytest.mark.parametrize(
    ("off_m", "sigma_m", "writes"),
    [(0.009, 0.001, False), (0.011, 0.001, True), (0.05, 0.03, False), (0.07, 0.03, True)],
)
def test_only_what_changed_by_enough_is_written(off_m, sigma_m, writes):
    """By more than 10 mm and by more than two sigma."""
    one = planner(memory_with(wanted(1.0)), x_m=1.0 + off_m, version=2, sigma_m=sigma_m)
    assert bool(plan(one, NEAR)) == writes
    assert state(one).state == ("pending" if writes else "verified")


@pytest.mark.parametrize("flag", ["surveyed", "retired"])
def test_other_flags_are_written(flag):
    one = planner(memory_with(wanted(1.0)), version=2, **{flag: True})
    (order,) = plan(one, NEAR)
    assert getattr(read(order.job.record.ljust(88, b"\0"), TAG).record, flag)


@pytest.mark.parametrize(
    "seer", [Seer("r1", 1, 30.1), Seer("r1", 1, 5.0, write_range_m=4.0)], ids=["light", "write"]
)
def test_too_far_away(seer):
    one = planner()
    assert plan(one, seer) == []
    assert state(one).state == "waiting"
    assert state(one).reason == "slot A: blank; slot B: blank"


def test_silence_is_answered_by_another_robot():
    one = planner()
    (first,) = plan(one, NEAR, AWAY)
    for s in (4.0, 8.0, 10.9):
        assert plan(one, NEAR, AWAY, s=s) == []
    assert plan(one, NEAR, AWAY, s=11.0) == []
    assert state(one, 11.0).reason == "no answer from r1"
    (second,) = plan(one, NEAR, AWAY, s=13.0)
    assert second.robot == "r2"
    assert second.job.job > first.job.job
    memory = first.job.record.ljust(88, b"\0")
    one.answer("r1", result(first, memory), round(14.0 * SECOND_NS))
    assert state(one, 14.0).state == "pending"
    failed = result(second, memory, "failed", reason="not older")
    one.answer("r2", failed, round(14.0 * SECOND_NS))
    assert state(one, 14.0).state == "verified"


def test_failures_are_tried_less_and_less_often():
    one, s, gaps = planner(), 0.0, []
    for _ in range(8):
        while not (orders := plan(one, NEAR, s=s)):
            s += 1.0
        gaps.append(s)
        failed = result(orders[0], None, "failed", reason="no answer from the tag")
        one.answer("r1", failed, round(s * SECOND_NS))
        assert state(one, s).reason == "no answer from the tag"
    gaps = [b - a for a, b in itertools.pairwise(gaps)]
    assert gaps == sorted(gaps)
    assert gaps[:4] == [2.0, 4.0, 8.0, 16.0]
    assert gaps[-1] == RULES.most_s


def test_a_robot_has_one_job_at_a_time_and_is_told_it_again():
    one = planner()
    one.wanted = {TAG: wanted(), "door": wanted()}
    one.heard("door", bytes(88))
    orders = one.plan({TAG: [NEAR], "door": [NEAR]}, 0, UTC)
    assert len(orders) == 1
    again = one.job_of("r1", 4 * SECOND_NS)
    assert (again.job, again.valid_s) == (orders[0].job.job, 6.0)
    assert one.job_of("r1", 10 * SECOND_NS) is None
    assert one.job_of("r2", 0) is None


def test_who_has_driven_on_keeps_nobody_waiting():
    one = planner()
    (first,) = plan(one, NEAR)
    assert plan(one, NEAR, AWAY, s=4.0) == []
    assert plan(one, AWAY, s=8.0) == []
    (second,) = plan(one, AWAY, s=9.1)
    assert second.robot == "r2"
    assert one.job_of("r1", 9 * SECOND_NS) is None
    late = result(first, first.job.record.ljust(88, b"\0"))
    one.answer("r1", late, round(9.5 * SECOND_NS))
    assert state(one, 9.5).state == "pending"
    one.answer("r2", result(second, late.read, "failed"), round(9.9 * SECOND_NS))
    assert state(one, 9.9).state == "verified"


def test_who_has_driven_on_gets_other_work():
    one = planner()
    one.wanted = {TAG: wanted(), "door": wanted()}
    one.heard("door", bytes(88))
    (first,) = one.plan({TAG: [NEAR]}, 0, UTC)
    assert first.job.tag == TAG
    assert one.plan({"door": [NEAR]}, 4 * SECOND_NS, UTC + 4) == []
    (second,) = one.plan({"door": [NEAR]}, 6 * SECOND_NS, UTC + 6)
    assert (second.robot, second.job.tag) == ("r1", "door")


def test_what_was_read_is_believed_and_not_what_was_said():
    one = planner()
    (order,) = plan(one, NEAR)
    one.answer("r1", result(order, bytes(88)), 0)
    assert state(one).state == "waiting"
    assert state(one).reason == "r1: written"


@pytest.mark.parametrize(
    ("memory", "reason"),
    [
        (memory_with(wanted(9.0, version=7)), "map version 7"),
        (bytes(8), "a memory of 8 bytes"),
    ],
    ids=["newer", "small"],
)
def test_what_cannot_be_written_is_said(memory, reason):
    one = planner(memory)
    assert plan(one, NEAR) == []
    assert state(one).state == "kept"
    assert reason in state(one).reason


def test_frozen_records_stay():
    frozen = replace(wanted(9.0).record(OWNER, 1), frozen=True)
    one = planner(encode_for(88, frozen, TAG).ljust(88, b"\0"), version=2)
    assert plan(one, NEAR) == []
    assert (state(one).state, state(one).reason) == ("kept", "the record there is frozen")


@pytest.mark.parametrize("fields", [{}, {"frozen": True}, {"cov": None}], ids=str)
@pytest.mark.parametrize("version", [0, 2])
def test_a_surveyed_record_gives_way_to_no_map(fields, version):
    """However far from it the map has the tag: people measured it, and people decide."""
    surveyed = replace(wanted(9.0).record(OWNER, 1), surveyed=True, map_version=version, **fields)
    one = planner(encode_for(88, surveyed, TAG).ljust(88, b"\0"), version=3)
    assert plan(one, NEAR) == []
    assert state(one).state == "kept"
    assert "surveyed" in state(one).reason


def test_a_surveyed_record_gives_way_to_another_survey():
    surveyed = memory_with(wanted(9.0, surveyed=True))
    one = planner(surveyed, version=2, surveyed=True)
    (order,) = plan(one, NEAR)
    told = read(order.job.record.ljust(88, b"\0"), TAG).record
    assert (told.surveyed, told.p_m[0]) == (True, 1.0)
    one = planner(surveyed, x_m=9.005, version=2, surveyed=True)
    assert plan(one, NEAR) == []
    assert state(one).state == "verified"


def test_a_retired_tag_is_marked_even_if_people_surveyed_it():
    one = planner(memory_with(wanted(1.0, surveyed=True)), version=2, surveyed=True, retired=True)
    (order,) = plan(one, NEAR)
    marked = order.job.record.ljust(88, b"\0")
    told = read(marked, TAG).record
    assert (told.surveyed, told.retired) == (True, True)
    one = planner(marked, version=3, retired=True)
    assert plan(one, NEAR) == []
    assert state(one).state == "verified"


def test_worn_memories_are_left_alone(monkeypatch):
    monkeypatch.setattr("tagmap.memory.writing.ENDURED_WRITES", 2)
    one = planner()
    for job in range(4):
        one.heard(TAG, bytes(88), job)
    assert plan(one, NEAR) == []
    assert state(one).state == "kept"
    assert "worn: written 4 times" in state(one).reason


def test_a_tag_that_is_on_no_anchored_map_waits():
    one = planner()
    one.wanted = {}
    assert plan(one, NEAR) == []
    assert state(one).state == "waiting"


@pytest.mark.parametrize("seed", range(40))
def test_every_tag_ends_verified(seed):
    """Robots die while they write, the service while they answer; then the trouble ends."""
    world = World(seed).run(60.0)
    for i, tag in enumerate(list(world.memories)[::2]):
        world.move(tag, 50.0 + i)
    world.run(60.0)
    world.faults = NONE
    world.run(4.0 * RULES.most_s)
    assert set(world.states().values()) == {"verified"}
    for tag, one in world.map.items():
        assert world.holds(tag) == one.map_version
    orders = len(world.orders)
    world.run(120.0)
    assert len(world.orders) == orders


@pytest.mark.parametrize("seed", range(10))
def test_nothing_is_written_twice_while_nobody_dies(seed):
    """However often jobs and answers are lost and doubled, and the service restarted."""
    faults = Faults(lost=0.4, doubled=0.4, robot_dies=0.0, service_dies=0.1, deaf=0.2)
    world = World(seed, faults=faults).run(120.0)
    assert max(world.writes.values()) == 1


def test_a_service_killed_between_write_and_answer():
    world = World(1, n_tags=3, n_robots=2, faults=NONE)
    world.run(0.1)
    while not any(world.writes.values()):
        world.run(0.05)
    world._start()
    world.events = [event for event in world.events if event[2] != world._answer]
    world.run(60.0)
    assert set(world.states().values()) == {"verified"}
    assert set(world.writes.values()) == {1}
