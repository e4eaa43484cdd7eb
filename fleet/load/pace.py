"""How fast robots send: at a steady rate, whatever comes back, or as fast as they are answered."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

from fleet.load.robot import Robot
from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import AdminRequest, Hello, encode

START_S = 30.0
PATIENCE_S = 120.0
WINDOW = 256
TURN_S = 0.002


@contextmanager
def connected(endpoint: str, hellos: Sequence[Hello]) -> Iterator[list[Robot]]:
    """Robots with their hellos settled, each on a session of its own, once the service answers."""
    keys = Keys(hellos[0].site)
    with ExitStack() as links:
        robots = [
            Robot(links.enter_context(Link.open([endpoint], wait_s=PATIENCE_S)), keys, hello)
            for hello in hellos
        ]
        robots[0].link.ask(keys.admin("site", "status"), encode(AdminRequest()), timeout_s=START_S)
        for robot in robots:
            robot.send_next()
        settle(robots)
        yield robots


def settle(robots: Sequence[Robot]) -> None:
    """Wait until everything sent is settled. LinkError when something is not, or was refused."""
    give_up_s = time.perf_counter() + PATIENCE_S
    while any(robot.in_flight for robot in robots):
        if time.perf_counter() > give_up_s:
            raise LinkError(f"keyframes are not settled after {PATIENCE_S:g} s")
        for robot in robots:
            robot.send_again()
        time.sleep(TURN_S)
    for robot in robots:
        if robot.refused:
            raise LinkError(f"{robot.hello.robot}: refused: {robot.refused[0]}")


def steady(robots: Sequence[Robot], count: int, rate_hz: float, enough: Callable[[], bool]) -> None:
    """`count` keyframes of each robot or until `enough`, one every 1 / rate, out of step."""
    began_s = time.perf_counter()
    for k in range(count):
        for n, robot in enumerate(robots):
            due_s = began_s + (k + n / len(robots)) / rate_hz
            time.sleep(max(0.0, due_s - time.perf_counter()))
            robot.send_next()
            robot.send_again()
        if enough():
            break
    settle(robots)


def burst(robots: Sequence[Robot], count: int) -> float:
    """`count` keyframes of each robot, as fast as acknowledgements allow; keyframes per second."""
    began_s = time.perf_counter()
    last = [robot.sent + count for robot in robots]
    while any(robot.sent < end for robot, end in zip(robots, last, strict=True)):
        if time.perf_counter() - began_s > PATIENCE_S:
            raise LinkError(f"a burst is not settled after {PATIENCE_S:g} s")
        for robot, end in zip(robots, last, strict=True):
            while robot.sent < end and robot.in_flight < WINDOW:
                robot.send_next()
            robot.send_again()
        time.sleep(TURN_S)
    settle(robots)
    return count * len(robots) / (time.perf_counter() - began_s)
