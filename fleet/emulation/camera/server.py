"""Stereo cameras on a TCP port, in true time; frames as robot_agent.cameras.frames has them."""

import contextlib
import selectors
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

from fleet.emulation.camera.faults import CameraFaults
from fleet.emulation.llrp.line import Line
from robot_agent.background import Background
from robot_agent.cameras.camera import Failure, StereoPair
from robot_agent.cameras.frames import (
    QUESTION_BYTES,
    BadFrame,
    Question,
    answer_to,
    decode_question,
)
from tagmap.errors import LinkError

LOOK_S = 0.1
LONGEST_WAIT_S = 0.5
"""A client is told so often that there is nothing new, and others get their turn."""
SEND_S = 2.0
"""A client that takes nothing for so long is let go."""

Pairs: TypeAlias = Callable[[int | None, float], StereoPair | Failure | None]
"""`pairs(after_t_ns, wait_s)`: the newest pair after that time (None: any), waited for no longer
than that; None: there is no newer one. Called from one thread."""


@dataclass(slots=True)
class _Client:
    socket: socket.socket
    received: bytearray = field(default_factory=bytearray)
    line: Line = Line.OPEN


class CameraServer(Background):
    """`with CameraServer(pairs) as server:` serves in a thread, any number of clients. At its end
    they are all cut off, and the port is free for the next one."""

    def __init__(
        self,
        pairs: Pairs,
        host: str = "127.0.0.1",
        port: int = 0,
        faults: CameraFaults | None = None,
    ) -> None:
        """Listens from now on; port 0 is any free one. Raises LinkError."""
        try:
            self._listener = socket.create_server((host, port))
        except (OSError, OverflowError) as cause:
            raise LinkError(f"cannot listen at {host}:{port}: {cause}") from None
        self._address: tuple[str, int] = self._listener.getsockname()[:2]
        self._pairs = pairs
        self._faults = faults or CameraFaults()
        self._clients: dict[int, _Client] = {}
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        super().__init__("camera-server", self._serve)

    @property
    def address(self) -> tuple[str, int]:
        return self._address

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        for client in tuple(self._clients.values()):
            self._drop(client)
        self._selector.close()
        self._listener.close()

    def _serve(self) -> None:
        while not self._stopping.is_set():
            for key, _ in self._selector.select(LOOK_S):
                if key.fileobj is self._listener:
                    self._accept()
                else:
                    self._read(self._clients[key.fd])

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            line, _ = self._listener.accept()
            line.settimeout(SEND_S)
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients[line.fileno()] = _Client(line)
            self._selector.register(line, selectors.EVENT_READ)

    def _read(self, client: _Client) -> None:
        """No bytes may end the emulator: who sends what is no question is let go."""
        try:
            received = client.socket.recv(QUESTION_BYTES)
            client.received += received
            if not received:
                self._drop(client)
            elif len(client.received) >= QUESTION_BYTES and client.line is Line.OPEN:
                question = decode_question(bytes(client.received[:QUESTION_BYTES]))
                del client.received[:QUESTION_BYTES]
                self._answer(client, question)
        except (OSError, BadFrame):
            self._drop(client)

    def _answer(self, client: _Client, question: Question) -> None:
        found = self._found(question)
        if isinstance(found, StereoPair):
            found = self._faults.spoil_pair(found)
            pieces, client.line = self._faults.spoil(answer_to(question.number, found))
        else:
            pieces = answer_to(question.number, found)
        for piece in pieces:
            client.socket.sendall(piece)
        if client.line is Line.CUT:
            self._drop(client)

    def _found(self, question: Question) -> StereoPair | Failure | None:
        """Waits by and by, so that it ends when it is to."""
        end_s = time.monotonic() + min(1e-3 * question.wait_ms, LONGEST_WAIT_S)
        while True:
            left_s = max(0.0, end_s - time.monotonic())
            found = self._pairs(question.after_ns, min(left_s, LOOK_S))
            if found is not None or left_s <= LOOK_S or self._stopping.is_set():
                return found

    def _drop(self, client: _Client) -> None:
        self._selector.unregister(client.socket)
        del self._clients[client.socket.fileno()]
        client.socket.close()
