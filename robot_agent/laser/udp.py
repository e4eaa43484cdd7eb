"""A laser with two mirrors on a network: commands and answers are datagrams, see datagram.py.

What the device answers tells what its clock says at most: the answer was given before it came, so
when the device shows `told + (until - came)` it is not later than `until` here.
"""

import secrets
import socket
from collections.abc import Callable

from robot_agent.laser.clock import now_ns
from robot_agent.laser.datagram import BYTES, BadDatagram, Datagram, Op, Refusal, decode
from robot_agent.laser.device import DeviceError, LaserDevice, Steps

TRIES = 3


class UdpLaser(LaserDevice):
    """`answer_s`: how long one try waits for its answer. Opens the device when first needed, and
    anew after it did not answer."""

    def __init__(
        self, host: str, port: int, answer_s: float = 0.02, clock: Callable[[], int] = now_ns
    ) -> None:
        self._address = (host, port)
        self._answer_s, self._clock = answer_s, clock
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._session: int | None = None
        self._number = 0
        self._steps: Steps | None = None
        self._told_us = self._came_ns = 0

    def probe(self) -> str:
        self._session = None
        answer = self._ask(Op.STATUS)
        x, y = answer.steps
        return f"laser at {self._name()}: mirrors at steps {x}, {y}"

    def steer(self, steps: Steps) -> None:
        self._steps = steps
        answer = self._ask(Op.STEER, steps)
        if answer.steps != steps:
            raise DeviceError(f"laser {self._name()}: mirrors at {answer.steps}, expected {steps}")

    def light(self, until_ns: int) -> None:
        if self._session is None:
            raise DeviceError(f"laser {self._name()} was lost since its mirrors were steered")
        until_us = self._told_us + (until_ns - self._came_ns) // 1000
        answer = self._exchange(Op.LIGHT, max(0, until_us), (0, 0))
        if answer.steps != self._steps:
            raise DeviceError(
                f"laser {self._name()}: mirrors at {answer.steps}, {self._steps} asked"
            )

    def dark(self) -> None:
        if self._ask(Op.DARK).lit:
            raise DeviceError(f"laser {self._name()} is on after it was told to be dark")

    def close(self) -> None:
        try:
            if self._session is not None:
                self.dark()
        finally:
            self._socket.close()

    def _ask(self, op: Op, steps: Steps = (0, 0)) -> Datagram:
        if self._session is None:
            self._open()
        return self._exchange(op, 0, steps)

    def _open(self) -> None:
        """A session of our own; the device is dark after it."""
        self._session, self._number = secrets.randbits(32), 0
        self._exchange(Op.OPEN, 0, (0, 0))

    def _exchange(self, op: Op, time_us: int, steps: Steps) -> Datagram:
        """Each try has a number of its own, so that a try that comes late undoes nothing."""
        session = self._session
        assert session is not None
        for _ in range(TRIES):
            self._number += 1
            sent = Datagram(op, session, self._number, time_us, steps)
            answer = self._answer_to(sent)
            if answer is None:
                continue
            if answer.refusal is not Refusal.DONE:
                if answer.refusal is Refusal.ANOTHER_SESSION:
                    self._session = None
                why = answer.refusal.name.lower().replace("_", " ")
                raise DeviceError(f"laser {self._name()} refused to {op.name.lower()}: {why}")
            self._told_us, self._came_ns = answer.time_us, self._clock()
            return answer
        self._session = None
        waited_ms = 1e3 * TRIES * self._answer_s
        raise DeviceError(
            f"laser {self._name()} did not answer {op.name.lower()} within {waited_ms:.0f} ms"
        )

    def _answer_to(self, sent: Datagram) -> Datagram | None:
        try:
            self._socket.sendto(sent.encode(), self._address)
            end_ns = self._clock() + round(self._answer_s * 1e9)
            while (left_ns := end_ns - self._clock()) > 0:
                self._socket.settimeout(left_ns * 1e-9)
                data, _ = self._socket.recvfrom(BYTES + 1)
                answer = _decoded(data)
                if answer and (answer.session, answer.number) == (sent.session, sent.number):
                    return answer if answer.answer else None
        except TimeoutError:
            return None
        except OSError as error:
            raise DeviceError(f"laser {self._name()}: {error.strerror or error}") from None
        return None

    def _name(self) -> str:
        return f"{self._address[0]}:{self._address[1]}"


def _decoded(data: bytes) -> Datagram | None:
    try:
        return decode(data)
    except BadDatagram:
        return None
