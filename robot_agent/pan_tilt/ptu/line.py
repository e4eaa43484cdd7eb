"""A serial line to a unit: one command at a time, asked again where the line was disturbed."""

import contextlib
import errno
import os
import time
from typing import Any

from robot_agent.pan_tilt.ptu import replies
from robot_agent.pan_tilt.ptu.replies import Garbled
from tagmap.errors import TagmapError

EXTRA = "pip install tagmap[pan-tilt]"
ATTEMPTS = 4
QUIET_S = 0.05
"""So long without a byte, the line has nothing left of what came before."""
NOISY_S = 1.0
"""A line that is not quiet by then is none to talk on."""
LOOK_S = 0.02
TAKEN = (errno.EAGAIN, errno.EBUSY)


class SerialUnavailable(TagmapError):
    """What the driver needs is not installed."""


class LineLost(Exception):
    """There is no unit at the other end that makes sense. Says why."""


def pyserial() -> Any:
    """The serial module. Raises SerialUnavailable, which says what to install."""
    try:
        import serial
    except ImportError as error:
        raise SerialUnavailable(f"pan-tilt units need pyserial ({error}): {EXTRA}") from None
    return serial


class Line:
    """Raises LineLost at construction where the port cannot be opened."""

    def __init__(self, port: str, baud: int, answer_s: float) -> None:
        serial = pyserial()
        self.asked_ns = 0
        """When the question that was answered last was sent, UTC."""
        self._answer_s = answer_s
        self._troubles = (OSError, serial.SerialException, ValueError)
        try:
            # A second program on the same port would take half of the answers.
            self._port = serial.Serial(
                port, baud, timeout=LOOK_S, write_timeout=answer_s, exclusive=True
            )
        except self._troubles as error:
            raise LineLost(f"cannot open: {_why(error)}") from None

    def ask(self, command: str, echo: bool | None) -> str:
        """The text of the answer. Raises Refused, and LineLost after ATTEMPTS.

        Every command that is sent may be sent twice: moves and speeds are absolute.
        """
        trouble = ""
        for attempt in range(ATTEMPTS):
            if attempt:
                self.quieten()
            try:
                return replies.answer(self._exchange(command), command, echo)
            except Garbled as error:
                trouble = str(error)
        raise LineLost(trouble)

    def ask_number(self, command: str, echo: bool | None) -> float:
        trouble = ""
        for _ in range(ATTEMPTS):
            try:
                return replies.number(self.ask(command, echo), command)
            except Garbled as error:
                trouble = str(error)
                self.quieten()
        raise LineLost(trouble)

    def ask_constant(self, command: str, echo: bool | None) -> float:
        """A number that everything rests on: said twice alike, for a disturbed digit is a digit."""
        before = self.ask_number(command, echo)
        for _ in range(ATTEMPTS):
            again = self.ask_number(command, echo)
            if again == before:
                return again
            before = again
        raise LineLost(f"{command} is answered otherwise each time, last {before:g}")

    def quieten(self) -> None:
        """End what the unit may have heard half of, and throw away what still arrives: the late
        answer to one question is none to the next."""
        self._write(" ")
        deadline = time.monotonic() + NOISY_S
        quiet_since = time.monotonic()
        while time.monotonic() - quiet_since < QUIET_S:
            if self._read():
                quiet_since = time.monotonic()
            if time.monotonic() > deadline:
                raise LineLost(f"noise for {NOISY_S:g} s, with nothing asked")

    def close(self) -> None:
        with contextlib.suppress(*self._troubles):
            self._port.close()

    def _exchange(self, command: str) -> bytes:
        self.asked_ns = time.time_ns()
        self._write(f"{command} ")
        received = b""
        deadline = time.monotonic() + self._answer_s
        while not replies.is_complete(received):
            received += self._read()
            if time.monotonic() > deadline and not replies.is_complete(received):
                if not received:
                    raise Garbled(f"no answer to {command} within {self._answer_s:g} s")
                break
        return received

    def _write(self, text: str) -> None:
        try:
            self._port.write(text.encode("ascii"))
        except self._troubles as error:
            raise LineLost(f"cannot send: {_why(error)}") from None

    def _read(self) -> bytes:
        try:
            received: bytes = self._port.read(max(1, self._port.in_waiting))
        except self._troubles as error:
            raise LineLost(_why(error)) from None
        return received


def _why(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number in TAKEN:
        return "another program has it open"
    return os.strerror(number) if number else str(error) or type(error).__name__
