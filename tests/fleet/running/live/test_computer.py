"""A robot's computer with a clock of its own."""

import json
import subprocess
import sys
import time

import pytest

from fleet.running.live import computer
from fleet.simulation.world.clock import RobotClock

HOUR_NS = 3_600_000_000_000
START_NS = 1_770_000_000 * 10**9
ASK = """
import sys, time, json
from robot_agent import cli
def ask(arguments, prog_name):
    from robot_agent.gear import Clocks
    from tagmap.clock import Clock
    print(json.dumps([arguments, time.time_ns(), Clock().utc_ns(), time.time(), time.monotonic()]))
cli.main = ask
from fleet.running.live import computer
computer.main()
"""


def test_only_a_clock_that_is_off_needs_a_computer_of_its_own():
    assert computer.is_right(RobotClock(START_NS, 0, 0.0))
    for wrong in (
        RobotClock(START_NS, 1, 0.0),
        RobotClock(START_NS, 0, 1e-6),
        RobotClock(START_NS, 0, 0.0, ((START_NS, 5),)),
    ):
        assert not computer.is_right(wrong)


@pytest.mark.parametrize("ahead_ns", [HOUR_NS, -HOUR_NS])
def test_its_programs_are_told_its_time_and_all_else_is_true(ahead_ns: int):
    """What the agent calls UTC; the clock that never jumps is the machine's."""
    clock = RobotClock(START_NS, 0, 0.0, ((START_NS, ahead_ns),))
    *_, told = computer.program(clock)
    before_ns, before_s = time.time_ns(), time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", ASK, told, "run", "--json"],
        capture_output=True,
        text=True,
        check=True,
    )
    after_ns, after_s = time.time_ns(), time.monotonic()
    arguments, utc_ns, clock_ns, utc_s, monotonic_s = json.loads(done.stdout)
    assert arguments == ["run", "--json"]
    for t_ns in (utc_ns, clock_ns, 1e9 * utc_s):
        assert before_ns <= t_ns - ahead_ns + 1000
        assert t_ns - ahead_ns <= after_ns + 1000
    assert before_s <= monotonic_s <= after_s
