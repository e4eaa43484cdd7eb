"""A robot as the service sees it: a Zenoh session that puts keyframes and times what comes back."""

import time
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from tagmap.conventions import Array
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import Ack, Hello, Keyframe, Pose, decode, encode

AGAIN_S = 2.0


@dataclass(slots=True)
class Robot:
    """Times are of perf_counter, by seq; 0 is the hello.

    put_s    first put
    ack_s    settled, as far as the robot has heard
    pose_s   a pose at least as new came, as far as there is one
    """

    link: Link
    keys: Keys
    hello: Hello
    put_s: list[float] = field(default_factory=list)
    ack_s: list[float] = field(default_factory=list)
    pose_s: list[float] = field(default_factory=list)
    resent: int = 0
    refused: list[str] = field(default_factory=list)
    _payloads: list[bytes] = field(default_factory=list)
    _t_ns: list[int] = field(default_factory=list)
    _again_s: float = 0.0

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
        return len(self._payloads) - len(self.put_s)

    def send_next(self) -> None:
        self._again_s = time.perf_counter()
        self.put_s.append(self._again_s)
        self._put(self.sent)

    def send_again(self) -> None:
        """What was lost on the way, as an agent does: when nothing has happened for a while."""
        now_s = time.perf_counter()
        if self.in_flight and now_s - self._again_s > AGAIN_S:
            self._again_s = now_s
            for seq in range(self.settled + 1, self.sent + 1):
                self.resent += 1
                self._put(seq)

    def times(self, after: int = 0) -> Array:
        """(3, N) of put, settled and pose, of keyframes sent after seq `after`; NaN: not yet."""
        n = len(self.put_s)
        found = np.full((3, n), np.nan)
        for row, known in zip(found, (self.put_s, self.ack_s, self.pose_s), strict=True):
            some = known[:n]
            row[: len(some)] = some
        return found[:, after + 1 :]

    def _put(self, seq: int) -> None:
        self.link.put(self.keys.keyframes(self.hello.robot), self._payloads[seq])

    def _on_ack(self, _key: str, payload: bytes) -> None:
        now_s = time.perf_counter()
        ack = decode(Ack, payload)
        self.refused.extend(refusal.reason for refusal in ack.refused)
        more = ack.contiguous - self.settled
        if more > 0:
            self._again_s = now_s
            self.ack_s.extend([now_s] * more)

    def _on_pose(self, _key: str, payload: bytes) -> None:
        now_s = time.perf_counter()
        seq = bisect_right(self._t_ns, decode(Pose, payload).t_ns) - 1
        self.pose_s.extend([now_s] * (seq + 1 - len(self.pose_s)))
