"""A robot's program on a computer whose clock is not that of the world.

`python -m fleet.running.live.computer CLOCK run --config ...`: `robot-agent` with these arguments,
where `time.time_ns` and `time.time` say what a world's RobotClock, as JSON, says. All other clocks
are the machine's: those that never jump are right on any computer, and logs can be compared.
"""

import sys
import time
from collections.abc import Callable

import msgspec

from fleet.simulation.world.clock import RobotClock

PROGRAM = (sys.executable, "-m", "fleet.running.live.computer")


def program(clock: RobotClock) -> tuple[str, ...]:
    """What runs `robot-agent` on such a computer."""
    return (*PROGRAM, msgspec.json.encode(clock).decode())


def is_right(clock: RobotClock) -> bool:
    """It says what the world's does, always."""
    return not (clock.offset_ns or clock.drift or clock.jumps)


def utc_ns(clock: RobotClock, world_ns: Callable[[], int]) -> Callable[[], int]:
    return lambda: clock.robot_ns(world_ns())


def main() -> None:
    clock = msgspec.json.decode(sys.argv[1], type=RobotClock)
    now_ns = utc_ns(clock, time.time_ns)
    # Before anything is imported that takes hold of them.
    time.time_ns = now_ns
    time.time = lambda: 1e-9 * now_ns()
    from robot_agent.cli import main as robot_agent

    robot_agent(sys.argv[2:], prog_name="robot-agent")


if __name__ == "__main__":
    main()
