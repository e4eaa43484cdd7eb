"""The queue and the leases, one step at a time."""

import pytest

from tagmap.arbitration.arbiter import Arbiter
from tagmap.arbitration.rules import SECOND_NS, Rules, Station, interfere

RULES = Rules()
UTC = 1_770_000_000 * SECOND_NS
HERE, FAR = Station((0.0, 0.0, 0.0)), Station((200.0, 0.0, 0.0))
NOWHERE = Station()


class Clock:
    """An arbiter whose silence is over, asked at times in s."""

    def __init__(self, start_s=10.0):
        self.arbiter = Arbiter.start(RULES, 0, UTC)
        self.now_ns = round(start_s * SECOND_NS)

    def wait(self, s):
        self.now_ns += round(s * SECOND_NS)

    def ask(self, robot, station=NOWHERE, wanted_s=1.0):
        return self.arbiter.ask(robot, wanted_s, station, self.now_ns, UTC + self.now_ns)

    def give_back(self, robot, lease):
        self.arbiter.give_back(robot, lease, self.now_ns, UTC + self.now_ns)


def test_one_at_a_time():
    clock = Clock()
    first = clock.ask("r1")
    assert first.valid_s == 1.0
    waiting = clock.ask("r2")
    assert waiting.lease is None
    assert 0.0 < waiting.retry_s <= RULES.ask_again_s
    clock.give_back("r1", first.lease)
    assert clock.ask("r2").lease > first.lease


def test_a_lease_ends_by_itself_and_not_before_its_holder_has_stopped():
    clock = Clock()
    clock.ask("r1")
    clock.wait(1.0)
    assert clock.ask("r2").lease is None
    clock.wait(1.0 * 2.1 * RULES.drift)
    assert clock.ask("r2").lease is not None


def test_no_lease_is_longer_than_the_longest():
    assert Clock().ask("r1", wanted_s=60.0).valid_s == RULES.max_lease_s


def test_silence_after_a_start():
    clock = Clock(0.0)
    assert clock.ask("r1").lease is None
    clock.wait(RULES.max_lease_s)
    answer = clock.ask("r1")
    assert answer.lease is None
    clock.wait(answer.retry_s)
    assert clock.ask("r1").lease is not None


def test_robots_far_apart_shoot_at_once():
    clock = Clock()
    assert clock.ask("r1", HERE).lease is not None
    assert clock.ask("r2", FAR).lease is not None
    assert clock.ask("r3", NOWHERE).lease is None


@pytest.mark.parametrize(
    ("apart_m", "radius_m", "reader_range_m", "interferes"),
    [
        (123.1, 0.0, None, False),
        (122.9, 0.0, None, True),
        (123.1, 0.2, None, True),
        (60.0, 0.0, 20.0, False),
        (123.1, 0.0, 86.0, True),
    ],
)
def test_range(apart_m, radius_m, reader_range_m, interferes):
    """85 m to the reader, 30 m to the tag, and both drive 2 m/s for 2 s and a little."""
    a = Station((0.0, 0.0, 0.0), radius_m, reader_range_m)
    b = Station((0.0, apart_m, 0.0), 0.0, 20.0 if reader_range_m == 20.0 else None)
    assert interfere(a, b, RULES) == interfere(b, a, RULES) == interferes


def test_of_different_dimensions_the_height_is_left_out():
    assert interfere(Station((0.0, 0.0)), Station((100.0, 0.0, 500.0)), RULES)
    assert not interfere(Station((0.0, 0.0)), Station((200.0, 0.0, 0.0)), RULES)


def test_nobody_is_overtaken():
    clock = Clock()
    held = clock.ask("r1")
    order = ["r4", "r2", "r3"]
    for robot in order:
        assert clock.ask(robot).lease is None
    clock.give_back("r1", held.lease)
    for robot in order:
        for other in reversed(order[order.index(robot) + 1 :]):
            assert clock.ask(other).lease is None
        held = clock.ask(robot)
        assert held.lease is not None
        clock.give_back(robot, held.lease)


def test_who_is_not_in_the_way_of_those_before_does_not_wait():
    clock = Clock()
    clock.ask("r1", HERE)
    assert clock.ask("r2", HERE).lease is None
    assert clock.ask("r3", FAR).lease is not None


def test_who_does_not_ask_again_loses_the_place():
    clock = Clock()
    clock.ask("r1", wanted_s=2.0)
    clock.ask("r2")
    clock.wait(1.5)
    clock.ask("r3")
    clock.wait(0.6)
    assert clock.ask("r3").lease is not None


def test_a_lost_answer_is_told_again_under_a_new_number():
    clock = Clock()
    first = clock.ask("r1")
    clock.wait(0.4)
    again = clock.ask("r1")
    assert again.lease > first.lease
    assert again.valid_s == pytest.approx(0.6, abs=1e-3)
    clock.give_back("r1", first.lease)
    assert clock.ask("r2").lease is None
    clock.give_back("r1", again.lease)
    assert clock.ask("r2").lease is not None


def test_a_holder_that_moved_into_the_way_is_not_told_again():
    clock = Clock()
    clock.ask("r1", HERE)
    clock.ask("r2", FAR)
    near = Station((150.0, 0.0, 0.0))
    assert clock.ask("r1", near).lease is None
    assert clock.ask("r1", HERE).lease is not None


def test_where_a_holder_was_first_counts_until_the_end():
    """It may have heard the first answer only."""
    clock = Clock()
    clock.ask("r1", HERE)
    clock.ask("r1", FAR)
    assert clock.ask("r2", HERE).lease is None
    assert clock.ask("r3", FAR).lease is None
    assert clock.ask("r4", Station((0.0, 300.0, 0.0))).lease is not None


def test_nobody_is_told_again_for_ever():
    clock = Clock()
    told = [clock.ask("r1", Station((0.01 * i, 0.0, 0.0))).lease for i in range(40)]
    assert None not in told[:16]
    assert set(told[16:]) == {None}


def test_giving_back_what_one_does_not_have():
    clock = Clock()
    held = clock.ask("r1")
    clock.give_back("r2", held.lease)
    clock.give_back("r1", held.lease + 1)
    assert clock.ask("r2").lease is None


def test_lapsed_and_unknown_identifications():
    clock = Clock()
    grants = clock.arbiter.grants
    held = clock.ask("r1")
    granted_ns, second = UTC + clock.now_ns, SECOND_NS
    assert held.lease == granted_ns
    assert grants.objection("r1", held.lease, granted_ns - 100 * second) is None
    assert grants.objection("r1", held.lease, granted_ns + 2 * second) is None
    late = grants.objection("r1", held.lease, granted_ns + 5 * second)
    assert late == f"lease {held.lease} was over 4.0 s before the keyframe"
    assert grants.objection("r2", held.lease, granted_ns) == f"lease {held.lease} is of robot r1"
    assert grants.objection("r1", held.lease + 1, granted_ns) == (
        f"lease {held.lease + 1} was never granted"
    )
    clock.wait(0.25)
    clock.give_back("r1", held.lease)
    late = grants.objection("r1", held.lease, granted_ns + 2 * second)
    assert late == f"lease {held.lease} was over 1.8 s before the keyframe"


def test_leases_from_before_a_restart_are_judged_by_their_time():
    grants = Arbiter.start(RULES, 0, UTC).grants
    before = UTC - 5 * SECOND_NS
    assert grants.objection("r1", before, before + SECOND_NS) is None
    assert "was over 3.0 s" in grants.objection("r1", before, before + 5 * SECOND_NS)
    assert grants.objection("r1", 12, 5 * SECOND_NS) is not None


def test_numbers_grow_though_the_time_of_day_may_not(monkeypatch):
    monkeypatch.setattr("tagmap.arbitration.grants.REMEMBERED", 3)
    grants = Arbiter.start(RULES, 0, UTC).grants
    leases = [grants.add("r1", 1.0, UTC - i) for i in range(6)]
    assert leases == list(range(UTC, UTC + 6))
    assert len(grants.known) == 3
    assert grants.objection("r2", leases[0], UTC) is None
    assert grants.objection("r2", leases[-1], UTC) is not None


def test_who_had_no_lease_for_longest_is_next():
    """r3 has never had one, and asks last: robots that stop for a moment only get their turn."""
    clock = Clock()
    for robot in ("r1", "r2"):
        clock.give_back(robot, clock.ask(robot).lease)
        clock.wait(1.0)
    held = clock.ask("r1")
    assert clock.ask("r2").lease is None
    assert clock.ask("r3").lease is None
    clock.give_back("r1", held.lease)
    assert clock.ask("r2").lease is None
    clock.give_back("r3", clock.ask("r3").lease)
    assert clock.ask("r2").lease is not None


def test_who_had_a_lease_is_not_remembered_for_ever():
    clock = Clock()
    clock.give_back("r1", clock.ask("r1").lease)
    assert set(clock.arbiter.served_ns) == {"r1"}
    clock.wait(3601.0)
    clock.give_back("r2", clock.ask("r2").lease)
    assert set(clock.arbiter.served_ns) == {"r2"}
