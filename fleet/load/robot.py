"""A robot as the service sees it: a Zenoh session that puts keyframes and times what comes back.

What is lost on the way it sends again as the agent does, by the agent's own rules.
"""

import time
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from robot_agent.flight import Flight, Parcel
from tagmap.conventions import Array
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import Ack, Hello, Keyframe, Pose, decode, encode

ANSWER_S = 1.0


@dataclass(slots=True)
class Robot:
    """Times are of perf_counter, by seq; 0 is the hello. `later(f)` calls f in another thread.

    put_s    first put
    ack_s    settled, as far as the robot has heard
    pose_s   a pose at least as new came, as far as there is one
    """

    link: Link
    keys: Keys
    hello: Hello
    later: Callable[[Callable[[], None]], object]
    put_s: list[float] = field(default_factory=list)
    ack_s: list[float] = field(default_factory=list)
    pose_s: list[float] = field(default_factory=list)
    resent: int = 0
    refused: list[str] = field(default_factory=list)
    _payloads: deque[bytes] = field(default_factory=deque)
    _t_ns: list[int] = field(default_factory=list)
    _flight: Flight = field(default_factory=Flight)
    _heard: deque[int] = field(default_factory=deque)

    def __post_init__(self) -> None:
        self._payloads.append(encode(self.hello))
        self._t_ns.append(-1)
        self.link.subscribe(self.keys.ack(self.hello.robot), self._on_ack)
        self.link.subscribe(self.keys.pose(self.hello.robot), self._on_pose)

    def take(self, keyframes: Iterable[Keyframe]) -> None:
        """What to send next, in the order of seq."""
        for keyframe in keyframes:
            self._payloads.append(encode(keyframe))
            self._t_ns.append(keyframe.t_ns)

    @property
    def sent(self) -> int:
        """The last seq that was put, -1 before the hello."""
        return len(self.put_s) - 1

    @property
    def settled(self) -> int:
        return len(self.ack_s) - 1

    @property
    def in_flight(self) -> int:
        return self.sent - self.settled

    @property
    def left(self) -> int:
        """How many have not been sent yet."""
        return len(self._payloads)

    def forget_unsent(self) -> None:
        del self._t_ns[len(self.put_s) :]
        self._payloads.clear()

    def send_next(self) -> None:
        parcel = Parcel(self.hello.session, self.sent + 1, self._payloads.popleft())
        self.put_s.append(time.perf_counter())
        self._put(parcel)
        self._flight.launch(parcel, time.monotonic_ns())

    def tend(self) -> None:
        """Take in what was heard, send again what is missing, ask when nothing is heard."""
        now_ns = time.monotonic_ns()
        while self._heard:
            _, missing = self._flight.acknowledge(self._heard.popleft(), now_ns)
            for parcel in missing:
                self.resent += 1
                self._put(parcel)
        if self._flight.asks(now_ns):
            self.later(self._ask)

    def times(self, after: int = 0) -> Array:
        """(3, N) of put, settled and pose, of keyframes sent after seq `after`; NaN: not yet."""
        n = len(self.put_s)
        found = np.full((3, n), np.nan)
        for row, known in zip(found, (self.put_s, self.ack_s, self.pose_s), strict=True):
            some = known[:n]
            row[: len(some)] = some
        return found[:, after + 1 :]

    def recent(self, since_s: float) -> Array:
        """`times` of what was put since then."""
        return self.times(bisect_left(self.put_s, since_s) - 1)

    def _put(self, parcel: Parcel) -> None:
        self.link.put(self.keys.keyframes(self.hello.robot), parcel.payload)

    def _ask(self) -> None:
        """No answer is no news; an error is an answer: nothing was heard of the session."""
        selector = f"{self.keys.ack(self.hello.robot)}?session={self.hello.session}"
        for reply in self.link.get(selector, timeout_s=ANSWER_S):
            if reply.payload is not None:
                self._on_ack(selector, reply.payload)
            elif reply.error != "Timeout":
                self._heard.append(-1)

    def _on_ack(self, _key: str, payload: bytes) -> None:
        now_s = time.perf_counter()
        ack = decode(Ack, payload)
        self.refused.extend(refusal.reason for refusal in ack.refused)
        self.ack_s.extend([now_s] * (ack.contiguous - self.settled))
        self._heard.append(ack.contiguous)

    def _on_pose(self, _key: str, payload: bytes) -> None:
        now_s = time.perf_counter()
        seq = bisect_right(self._t_ns, decode(Pose, payload).t_ns) - 1
        self.pose_s.extend([now_s] * (seq + 1 - len(self.pose_s)))
