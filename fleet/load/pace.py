"""How fast robots send: at a steady rate, whatever comes back, or as fast as they are answered."""

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager

from fleet.load.robot import Robot
from tagmap.conventions import Array
from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import AdminRequest, Hello, encode

START_S = 30.0
ASKING = 4
PATIENCE_S = 120.0
WINDOW = 256
TURN_S = 0.002


@contextmanager
def connected(endpoint: str, hellos: Sequence[Hello]) -> Iterator[list[Robot]]:
    """Robots with their hellos settled, each on a session of its own, once the service answers."""
    keys = Keys(hellos[0].site)
    with ExitStack() as opened:
        links = [opened.enter_context(Link.open([endpoint], wait_s=PATIENCE_S)) for _ in hellos]
        asking = opened.enter_context(ThreadPoolExecutor(ASKING))
        robots = [
            Robot(link, keys, hello, asking.submit)
            for link, hello in zip(links, hellos, strict=True)
        ]
        links[0].ask(keys.admin("site", "status"), encode(AdminRequest()), timeout_s=START_S)
        for robot in robots:
            robot.send_next()
        settle(robots)
        yield robots


def settle(robots: Sequence[Robot]) -> None:
    """Wait until everything sent is settled. LinkError when something is not, or was refused."""
    if not drain(robots, PATIENCE_S, lambda: False):
        raise LinkError(f"keyframes are not settled after {PATIENCE_S:g} s")
    for robot in robots:
        if robot.refused:
            raise LinkError(f"{robot.hello.robot}: refused: {robot.refused[0]}")


def drain(robots: Sequence[Robot], patience_s: float, stopped: Callable[[], bool]) -> bool:
    """Whether everything sent is settled within that time, refused or not."""
    give_up_s = time.perf_counter() + patience_s
    while any(robot.in_flight for robot in robots):
        if time.perf_counter() > give_up_s or stopped():
            return False
        for robot in robots:
            robot.tend()
        time.sleep(TURN_S)
    return True


def steady(robots: Sequence[Robot], count: int, rate_hz: float, enough: Callable[[], bool]) -> None:
    """`count` keyframes of each robot or until `enough`, one every 1 / rate, out of step."""
    phases = [n / len(robots) for n in range(len(robots))]
    for _ in paced(robots, phases, count, rate_hz):
        if enough():
            break
    settle(robots)


def paced(
    robots: Sequence[Robot], phases: Sequence[float] | Array, count: int, rate_hz: float
) -> Iterator[float]:
    """`count` keyframes of each robot at a steady rate; `phases` (N,) in periods, ascending.

    Yields once a period, after it, by how many s the worst of its keyframes was late.
    """
    began_s = time.perf_counter()
    for k in range(count):
        late_s = 0.0
        for phase, robot in zip(phases, robots, strict=True):
            robot.tend()
            if not robot.left:
                continue
            due_s = began_s + (k + phase) / rate_hz
            time.sleep(max(0.0, due_s - time.perf_counter()))
            robot.send_next()
            late_s = max(late_s, robot.put_s[-1] - due_s)
        yield late_s
        if not any(robot.left for robot in robots):
            return


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
            robot.tend()
        time.sleep(TURN_S)
    settle(robots)
    return count * len(robots) / (time.perf_counter() - began_s)
