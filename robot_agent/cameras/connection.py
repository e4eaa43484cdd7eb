"""One TCP connection to a camera server: one question at a time, and its answer, which may arrive
over several calls."""

import socket
import time

import numpy as np
import numpy.typing as npt

from robot_agent.cameras.camera import Failure, Reason, Size, StereoPair, wrong_with
from robot_agent.cameras.frames import (
    ANSWER_BYTES,
    DTYPES,
    BadFrame,
    Header,
    Kind,
    Question,
    decode_header,
)
from robot_agent.perception.spots import Image

SILENT_S = 2.0
"""A server that owes an answer and sends nothing for so long is not there any more."""
NUMBERS = 2**32


class Lost(Exception):
    """The connection is of no use any more. `reason` as in camera.Failure."""

    def __init__(self, reason: Reason, why: str) -> None:
        super().__init__(why)
        self.reason = reason


class Connection:
    """Raises Lost, and TimeoutError from `answer`; nothing else."""

    def __init__(self, host: str, port: int, timeout_s: float) -> None:
        try:
            self._line = socket.create_connection((host, port), timeout_s)
            self._line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            is_own = self._line.getsockname() == self._line.getpeername()
        except TimeoutError:
            raise Lost("camera_gone", f"cannot connect within {timeout_s:.2g} s") from None
        except (OSError, ValueError) as error:
            raise Lost("camera_gone", f"cannot connect: {_told(error)}") from None
        if is_own:
            # A port that nobody listens on can be connected to itself.
            self.close()
            raise Lost("camera_gone", "cannot connect: nobody listens")
        self._number = 0
        self._incoming: _Incoming | None = None
        self._heard_s = 0.0

    @property
    def is_asked(self) -> bool:
        """Whether an answer is still to come."""
        return self._incoming is not None

    @property
    def is_fresh(self) -> bool:
        """Whether nothing was asked yet."""
        return self._number == 0

    def ask(self, after_ns: int | None, wait_s: float) -> None:
        self._number = (self._number + 1) % NUMBERS or 1
        try:
            self._line.settimeout(SILENT_S)
            self._line.sendall(Question(self._number, after_ns, round(1e3 * wait_s)).encode())
        except OSError as error:
            raise Lost("camera_gone", _told(error)) from None
        self._incoming = _Incoming(self._number)
        self._heard_s = time.monotonic() + wait_s

    def answer(
        self, deadline_s: float, expected: tuple[Size, Size] | None
    ) -> StereoPair | Failure | None:
        """None: nothing new. `deadline_s` is of time.monotonic(); what has arrived by then is kept
        for the next call. expected: sizes of the rig, if there is one."""
        incoming = self._incoming
        assert incoming is not None
        while (room := incoming.room) is not None:
            self._receive(incoming, room, deadline_s)
            try:
                incoming.look(expected)
            except BadFrame as bad:
                raise Lost(bad.reason, str(bad)) from None
        self._incoming = None
        return incoming.answer()

    def close(self) -> None:
        self._line.close()

    def _receive(self, incoming: "_Incoming", room: memoryview, deadline_s: float) -> None:
        try:
            self._line.settimeout(max(0.0, deadline_s - time.monotonic()))
            count = self._line.recv_into(room)
        except (TimeoutError, BlockingIOError):
            silent_s = time.monotonic() - self._heard_s
            if silent_s > SILENT_S:
                raise Lost("stalled", f"has sent nothing for {silent_s:.1f} s") from None
            raise TimeoutError from None
        except OSError as error:
            raise Lost("camera_gone", _told(error)) from None
        if count == 0:
            raise Lost("camera_gone", f"hung up {incoming.told()}")
        self._heard_s = max(self._heard_s, time.monotonic())
        incoming.got += count


class _Incoming:
    """An answer as it arrives: the header, then pixels and text in one buffer."""

    def __init__(self, number: int) -> None:
        self.got = 0
        self._number = number
        self._start: npt.NDArray[np.uint8] = np.empty(ANSWER_BYTES, np.uint8)
        self._header: Header | None = None
        self._body: npt.NDArray[np.uint8] | None = None

    @property
    def room(self) -> memoryview | None:
        """Where the next bytes go; None: all are there."""
        part = self._start if self._body is None else self._body
        return part.data[self.got :] if self.got < len(part) or self._body is None else None

    def look(self, expected: tuple[Size, Size] | None) -> None:
        """Take the header apart once it is there. Raises BadFrame."""
        if self._body is not None or self.got < ANSWER_BYTES:
            return
        header = decode_header(self._start.tobytes())
        if header.number != self._number:
            why = f"answers question {header.number}, asked was {self._number}"
            raise BadFrame("camera_gone", why)
        self._header, self.got = header, 0
        self._body = np.empty(sum(header.side_bytes) + header.text_bytes, np.uint8)
        if header.kind is Kind.PAIR:
            wrong = wrong_with(*self._images(header), expected)
            if wrong is not None:
                raise BadFrame(wrong.reason, wrong.detail)

    def answer(self) -> StereoPair | Failure | None:
        header = self._header
        assert header is not None
        assert self._body is not None
        if header.kind is Kind.NOTHING_NEW:
            return None
        text = self._body[sum(header.side_bytes) :].tobytes().decode(errors="replace")
        if header.reason is not None:
            return Failure(header.reason, " ".join(text.split()))
        left, right = self._images(header)
        return StereoPair(left, right, header.t_ns, header.skew_ns, text)

    def told(self) -> str:
        if self._body is not None:
            return f"after {self.got} of {len(self._body)} bytes of a pair"
        return "within an answer" if self.got else "without an answer"

    def _images(self, header: Header) -> tuple[Image, Image]:
        """Views of the pixels."""
        assert self._body is not None
        left_bytes, right_bytes = header.side_bytes
        pixels = self._body[: left_bytes + right_bytes].view(DTYPES[header.bits])
        pixels = pixels.astype(pixels.dtype.newbyteorder("="), copy=False)
        (left_w, left_h), (right_w, right_h) = header.left_px, header.right_px
        split = left_w * left_h
        return pixels[:split].reshape(left_h, left_w), pixels[split:].reshape(right_h, right_w)


def _told(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
