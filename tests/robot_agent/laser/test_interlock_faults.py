"""Whatever happens to device, clocks, loop and program: never a light outside its window."""

import contextlib
import random

import pytest

from robot_agent.laser.interlock import SECOND_NS
from tests.robot_agent.laser.world import (
    APART_NS,
    LIMITS,
    FaultyLaser,
    Killed,
    World,
    direction,
    interlock_on,
)

ACTS = ("beat",) * 8 + ("wait",) * 5 + ("steer",) * 3 + ("light",) * 12 + ("allow", "dark") * 2
ACTS += ("revoke", "check", "moved", "stop", "jump", "breaks")


class Run:
    def __init__(self, seed):
        self.rng = random.Random(seed)
        self.world = World(self.rng, jumping=self.rng.randrange(2))
        self.device = FaultyLaser(self.world, faulty=False)
        self.interlock = interlock_on(self.world, self.device)
        self.stopped_after = None

    def play(self, acts=30):
        # Half of the runs begin well, so that there is light for the faults to come to.
        if self.rng.random() < 0.8:
            for act in ("beat", "allow", "steer", "light"):
                getattr(self, act)()
        self.device.faulty = True
        for _ in range(acts):
            if not self._do(self.rng.choice(ACTS)):
                break
        self.world.passes(5.0)
        self.device.is_on()

    def _do(self, act):
        try:
            getattr(self, act)()
        except Killed:
            return False
        except ZeroDivisionError:
            pass
        self._look()
        return True

    def _look(self):
        """A device that answers is dark where the interlock takes it to be."""
        if self.stopped_after is not None:
            assert self.device.lights == self.stopped_after
        if self.rng.random() < 0.3:
            self.device.faulty = False
            assert self.interlock.is_lit() or not self.device.is_on()
            self.device.faulty = True

    def beat(self):
        self.interlock.beat()
        self.world.beat_ns = self.world.t_ns

    def wait(self):
        self.world.passes(self.rng.choice([0.001, 0.02, 0.1, 0.4]) * self.rng.random())

    def steer(self):
        out = self.rng.random() < 0.2
        steps = (self.rng.randint(-50, 50), self.rng.randint(-20, 60))
        steps = (steps[0] + 200, steps[1]) if out else steps
        if self.interlock.steer(steps) is None:
            assert not out

    def light(self):
        for_s = self.rng.choice([0.02, 0.06, 0.1, 0.25, 0.35, -0.1])
        if self.interlock.light(for_s) is None:
            assert 0.0 <= for_s <= LIMITS.longest_s

    def allow(self):
        since = self.interlock.mark()
        ends_ns = self.world.clock() + round(2.0 * self.rng.random() * SECOND_NS)
        true_ns = ends_ns - self.world.jumped[0]
        if self.rng.random() < 0.05:
            self.jump()
        self.interlock.allow(lambda now_ns, s: now_ns + round(s * SECOND_NS) <= ends_ns, since)
        self.world.permit_ends_ns = true_ns

    def revoke(self):
        self.interlock.allow(None, self.interlock.mark())
        self.world.permit_ends_ns = 0

    def check(self):
        self.interlock.check()

    def dark(self):
        self.interlock.dark()

    def moved(self):
        self.interlock.moved()

    def stop(self):
        if self.rng.random() < 0.2:
            self.interlock.stop()
            self.stopped_after = self.device.lights

    def jump(self):
        """Suspended, set by hand, or broken: one of the clocks, by more than may go
        unnoticed; the other one of this run keeps time."""
        by_ns = round(self.rng.choice([0.006, 0.05, 0.5, 3.0, 1e4]) * SECOND_NS)
        self.world.jumped[self.world.jumping] += self.rng.choice([-1, 1]) * by_ns

    def breaks(self):
        """Anything in the program that uses it raises."""
        if self.rng.random() < 0.2:
            with contextlib.suppress(RuntimeError), self.interlock:
                raise RuntimeError("a bug elsewhere")
            self.stopped_after = self.device.lights

    def judge(self):
        assert not self.device.beyond
        assert not self.device.steered_lit
        for lit in self.device.record:
            bearing, elevation = direction(lit.steps)
            assert LIMITS.bearing_rad[0] <= bearing <= LIMITS.bearing_rad[1]
            assert LIMITS.elevation_rad[0] <= elevation <= LIMITS.elevation_rad[1]
        self._judge_dwell()
        return sum(lit.to_ns - lit.from_ns for lit in self.device.record)

    def _judge_dwell(self):
        """No stretch from the beginning of one window to the end of another holds too much."""
        record = self.device.record
        for i, first in enumerate(record):
            lit_ns = 0
            for last in record[i:]:
                lit_ns += last.to_ns - last.from_ns
                most_ns = LIMITS.dwell_s * SECOND_NS + LIMITS.refill * (last.to_ns - first.from_ns)
                assert lit_ns <= most_ns + APART_NS


def runs(seeds):
    lit_ns = 0
    for seed in seeds:
        run = Run(seed)
        run.play()
        lit_ns += run.judge()
    return lit_ns / SECOND_NS


def test_no_fault_lets_light_out_of_its_window():
    assert runs(range(2000)) > 5.0


@pytest.mark.slow
def test_no_fault_lets_light_out_of_its_window_in_full():
    assert runs(range(10_000, 110_000)) > 300.0
