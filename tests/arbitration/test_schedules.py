"""What leases promise, over random schedules, faults and clocks."""

from dataclasses import replace

import pytest

from tagmap.arbitration.arbiter import Arbiter
from tagmap.arbitration.holder import Holder
from tagmap.arbitration.rules import SECOND_NS, Rules
from tests.arbitration.world import NONE, Faults, World

# Clocks that are off by 5 % make in seconds what good clocks make in an hour.
RULES = Rules(drift=0.05)
SHORT, FULL = range(12), range(12, 112)
RUN_S = 60.0


def run(seed, **changes):
    return World(RULES, seed, **changes).run(RUN_S)


@pytest.mark.parametrize("hall_m", [50.0, 300.0])
@pytest.mark.parametrize("seed", SHORT)
def test_no_two_robots_in_range_may_shoot_together(seed, hall_m):
    world = run(seed, hall_m=hall_m)
    assert world.violations == []
    assert sum(robot.leases for robot in world.robots.values()) > 10


@pytest.mark.slow
@pytest.mark.parametrize("seed", FULL)
def test_no_two_robots_in_range_may_shoot_together_in_full(seed):
    for hall_m in (50.0, 150.0, 300.0):
        assert run(seed, hall_m=hall_m).violations == []


def test_robots_out_of_range_do_shoot_together():
    """Else the promise would be kept by never granting anything."""
    both = 0
    world = World(RULES, 1, hall_m=1000.0, faults=NONE)
    for _ in range(200):
        world.run(0.1)
        shooting = [r for r in world.robots.values() if r.holder.may_shoot(r.clock.at(world.t_ns))]
        both += len(shooting) > 1
    assert both > 20


def wait_bound_s(n_robots, answer_s):
    """All who came before, once each: their lease, or their patience when they do not come."""
    turn_s = RULES.withheld_s(RULES.max_lease_s) + RULES.patience_s + RULES.ask_again_s + answer_s
    return (n_robots + 1) * turn_s / (1.0 - RULES.drift)


@pytest.mark.parametrize("seed", range(4))
def test_everybody_in_range_gets_a_fair_share(seed):
    world = World(RULES, seed, n_robots=8, hall_m=20.0, faults=NONE).run(3.0 * RUN_S)
    leases = [robot.leases for robot in world.robots.values()]
    assert min(leases) > 10
    assert max(leases) - min(leases) <= 2
    longest_s = max(robot.longest_wait_ns for robot in world.robots.values()) / SECOND_NS
    assert longest_s <= wait_bound_s(8, 0.1)


@pytest.mark.parametrize("seed", range(6))
def test_after_any_trouble_everybody_gets_a_lease_again(seed):
    world = run(seed, hall_m=100.0, faults=Faults(lost=0.3, robot_dies=0.02, service_dies=0.02))
    assert world.violations == []
    world.faults = NONE
    before = {robot.name: robot.leases for robot in world.robots.values()}
    world.run(wait_bound_s(5, 4.0) + RULES.max_lease_s)
    assert all(robot.leases > before[robot.name] for robot in world.robots.values())


def no_silence(rules, now_ns, utc_ns):
    arbiter = Arbiter.start(rules, now_ns, utc_ns)
    arbiter.silent_until_ns = now_ns
    return arbiter


def no_drift(rules, now_ns, utc_ns):
    return Arbiter.start(replace(rules, drift=0.0), now_ns, utc_ns)


def no_driving(rules, now_ns, utc_ns):
    return Arbiter.start(replace(rules, speed_mps=0.0, laser_range_m=0.0), now_ns, utc_ns)


class FromTheAnswer(Holder):
    """Counts the lease from when it heard of it."""

    def take(self, ticket, lease, valid_s, retry_s, now_ns):
        if self.asked_ns is not None:
            self.asked_ns = now_ns
        super().take(ticket, lease, valid_s, retry_s, now_ns)


class AnyAnswer(Holder):
    """Takes answers to questions it has given up."""

    def take(self, _ticket, lease, valid_s, retry_s, now_ns):
        self.asked_ns = self.asked_ns or now_ns
        super().take(self.ticket, lease, valid_s, retry_s, now_ns)


@pytest.mark.parametrize("start", [no_silence, no_drift, no_driving])
def test_the_world_is_hard_enough_to_notice_a_service_without(start):
    assert any(run(seed, hall_m=150.0, begin=start).violations for seed in range(20))


@pytest.mark.parametrize("holder", [FromTheAnswer, AnyAnswer])
def test_the_world_is_hard_enough_to_notice_a_robot_that(holder, monkeypatch):
    monkeypatch.setattr("tests.arbitration.world.Holder", holder)
    assert any(run(seed, hall_m=50.0).violations for seed in range(20))
