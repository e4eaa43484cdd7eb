"""Robots as the service sees them: Zenoh sessions that put keyframes and time what comes back."""

import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import numpy as np

from fleet.benchmarks.swarm import Member
from tagmap.conventions import Array
from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import Ack, AdminRequest, Pose, decode, encode

START_S = 30.0
AGAIN_S = 2.0
PATIENCE_S = 120.0
WINDOW = 256
TURN_S = 0.002


@dataclass(slots=True)
class Robot:
    """One member of a swarm on a session of its own. Times are of perf_counter, by seq; 0 is hello.

    put_s    first put
    ack_s    settled, NaN before
    pose_s   a pose at least as new came, NaN before
    """

    link: Link
    keys: Keys
    member: Member
    put_s: Array = field(init=False)
    ack_s: Array = field(init=False)
    pose_s: Array = field(init=False)
    sent: int = -1
    settled: int = -1
    posed: int = 0
    resent: int = 0
    refused: list[str] = field(default_factory=list)
    _payloads: list[bytes] = field(init=False)
    _t_ns: list[int] = field(init=False)
    _again_s: float = 0.0

    def __post_init__(self) -> None:
        self._payloads = [encode(self.member.hello), *map(encode, self.member.keyframes)]
        self._t_ns = [k.t_ns for k in self.member.keyframes]
        self.put_s, self.ack_s, self.pose_s = np.full((3, len(self._payloads)), np.nan)
        robot = self.member.hello.robot
        self.link.subscribe(self.keys.ack(robot), self._on_ack)
        self.link.subscribe(self.keys.pose(robot), self._on_pose)

    @property
    def in_flight(self) -> int:
        return self.sent - self.settled

    def send_next(self) -> None:
        self.sent += 1
        self.put_s[self.sent] = self._again_s = time.perf_counter()
        self._put(self.sent)

    def send_again(self) -> None:
        """What was lost on the way, as an agent does: when nothing has happened for a while."""
        now_s = time.perf_counter()
        if self.in_flight and now_s - self._again_s > AGAIN_S:
            self._again_s = now_s
            for seq in range(self.settled + 1, self.sent + 1):
                self.resent += 1
                self._put(seq)

    def _put(self, seq: int) -> None:
        self.link.put(self.keys.keyframes(self.member.hello.robot), self._payloads[seq])

    def _on_ack(self, _key: str, payload: bytes) -> None:
        now_s = time.perf_counter()
        ack = decode(Ack, payload)
        self.refused.extend(refusal.reason for refusal in ack.refused)
        if ack.contiguous > self.settled:
            self.ack_s[self.settled + 1 : ack.contiguous + 1] = self._again_s = now_s
            self.settled = ack.contiguous

    def _on_pose(self, _key: str, payload: bytes) -> None:
        now_s = time.perf_counter()
        seq = bisect_right(self._t_ns, decode(Pose, payload).t_ns)
        if seq > self.posed:
            self.pose_s[self.posed + 1 : seq + 1] = now_s
            self.posed = seq


@contextmanager
def connected(endpoint: str, members: Sequence[Member]) -> Iterator[list[Robot]]:
    """All members with their hellos settled, once the service answers."""
    with ExitStack() as links:
        robots = [
            Robot(
                links.enter_context(Link.open([endpoint], wait_s=PATIENCE_S)),
                Keys(member.hello.site),
                member,
            )
            for member in members
        ]
        keys = Keys(members[0].hello.site)
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
            raise LinkError(f"{robot.member.hello.robot}: refused: {robot.refused[0]}")


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
