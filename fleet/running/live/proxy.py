"""A participant's line to the router, which can be cut, made slow, or long.

Below Zenoh's own framing: what passes is never changed, left out or repeated, for that would not be
a bad network, TCP sees to those, but a broken router.
"""

import contextlib
import selectors
import socket
import threading
import time
from dataclasses import dataclass
from typing import TypeAlias

from fleet.running.live.way import HELD_BYTES, Throttle, Way
from robot_agent.background import Background
from tagmap.errors import LinkError

HOST = "127.0.0.1"
LOOK_S, SOON_S = 0.1, 0.01
CONNECT_S = 2.0
BACKLOG = 64

Address: TypeAlias = tuple[str, int]


@dataclass(slots=True)
class _Call:
    """One connection: `up` to the router, `down` from it."""

    up: Way
    down: Way

    @property
    def sockets(self) -> tuple[socket.socket, socket.socket]:
        return self.up.source, self.down.source

    def close(self) -> None:
        for line in self.sockets:
            line.close()


class Proxy(Background):
    """`with Proxy(router_address) as proxy:` listens at `address` and connects whoever comes.

    Cut, nothing passes in either direction and nobody is told: what was sent waits, as it does
    where a cable was pulled out, and new connections are taken and never answered. The two sides
    find out by themselves, or hear the rest when it is healed.
    """

    def __init__(self, target: Address) -> None:
        """Listens from now on. Raises LinkError."""
        try:
            self._listener = socket.create_server((HOST, 0), backlog=BACKLOG)
        except OSError as cause:
            raise LinkError(f"cannot listen at {HOST}: {cause}") from None
        _narrow(self._listener)
        self._listener.setblocking(False)
        self.address: Address = self._listener.getsockname()[:2]
        self._target = target
        self._calls: list[_Call] = []
        self._is_cut, self._delay_s = False, 0.0
        self._down_per_s: float | None = None
        self._lock = threading.Lock()
        super().__init__("proxy", self._work)

    @property
    def endpoint(self) -> str:
        return f"tcp/{self.address[0]}:{self.address[1]}"

    def cut(self) -> None:
        """From the return of this call on."""
        with self._lock:
            self._is_cut = True

    def heal(self) -> None:
        with self._lock:
            self._is_cut = False

    def delay(self, delay_s: float) -> None:
        """Of what comes from now on, in each direction."""
        with self._lock:
            self._delay_s = delay_s

    def slow(self, bytes_per_s: float | None) -> None:
        """So much goes to the participant; None: everything."""
        with self._lock:
            self._down_per_s = bytes_per_s
            for call in self._calls:
                call.down.throttle.bytes_per_s = bytes_per_s

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        for call in self._calls:
            call.close()
        self._listener.close()

    def _work(self) -> None:
        while not self._stopping.is_set():
            self._look()
            with self._lock:
                if not self._is_cut:
                    self._pass(time.monotonic())

    def _look(self) -> None:
        """Until something comes in, or what is here may be due."""
        with self._lock:
            is_cut = self._is_cut
        if is_cut:
            self._stopping.wait(SOON_S)
            return
        ways = [way for call in self._calls for way in (call.up, call.down)]
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener, selectors.EVENT_READ)
            for way in ways:
                if way.wants():
                    selector.register(way.source, selectors.EVENT_READ)
            selector.select(SOON_S if any(way.holds() for way in ways) else LOOK_S)

    def _pass(self, now_s: float) -> None:
        self._accept()
        for call in tuple(self._calls):
            try:
                for way in (call.up, call.down):
                    if way.wants():
                        way.take(now_s + self._delay_s)
                    way.give(now_s)
                is_over = call.up.has_ended and call.down.has_ended
            except OSError:
                is_over = True
            if is_over:
                call.close()
                self._calls.remove(call)

    def _accept(self) -> None:
        """Whoever comes while there is no router is hung up on."""
        with contextlib.suppress(OSError):
            near, _ = self._listener.accept()
            far = socket.socket()
            try:
                _narrow(far)
                far.settimeout(CONNECT_S)
                far.connect(self._target)
            except OSError:
                near.close()
                far.close()
                return
            for line in (near, far):
                line.setblocking(False)
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            down = Way(far, near, Throttle(self._down_per_s))
            self._calls.append(_Call(Way(near, far, Throttle()), down))


def _narrow(line: socket.socket) -> None:
    """What waits, waits with whoever sent it: nothing is to hide in the buffers of the machine."""
    for which in (socket.SO_RCVBUF, socket.SO_SNDBUF):
        line.setsockopt(socket.SOL_SOCKET, which, HELD_BYTES)
