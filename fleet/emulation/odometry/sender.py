"""What an emulated base controller's wheels reckon, as datagrams, in true time."""

import contextlib
import secrets
import socket
import time
from collections.abc import Callable

from robot_agent.background import Background
from robot_agent.odometry.datagram import Datagram, Reckoned

RATE_HZ = 50.0


class OdometrySender(Background):
    """`with OdometrySender(reading, host, port):` sends `reading(now_ns)` (UTC) `rate_hz` times a
    second, where it is not None. Every sender begins an epoch of its own. Each `lose_every`-th
    datagram is lost on the way, each `repeat_every`-th comes twice; 0: none.
    """

    def __init__(
        self,
        reading: Callable[[int], Reckoned | None],
        host: str,
        port: int,
        rate_hz: float = RATE_HZ,
        lose_every: int = 0,
        repeat_every: int = 0,
    ) -> None:
        self._reading = reading
        self._address = host, port
        self._period_s = 1.0 / rate_hz
        self._lose_every, self._repeat_every = lose_every, repeat_every
        self.epoch = secrets.randbits(32)
        super().__init__("odometry-sender", self._send)

    def _send(self) -> None:
        number, due_s = 0, time.monotonic()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            while not self._stopping.wait(max(0.0, due_s - time.monotonic())):
                # One that was held up goes on from now: what is past is not sent in a burst.
                due_s = max(due_s + self._period_s, time.monotonic())
                reckoned = self._reading(time.time_ns())
                if reckoned is None:
                    continue
                number += 1
                content = Datagram(self.epoch, number % 2**32, reckoned).encode()
                for _ in range(self._copies(number)):
                    # Where nobody listens, an ICMP message comes as an error of the next call.
                    with contextlib.suppress(OSError):
                        line.sendto(content, self._address)

    def _copies(self, number: int) -> int:
        if self._lose_every and number % self._lose_every == 0:
            return 0
        return 2 if self._repeat_every and number % self._repeat_every == 0 else 1
