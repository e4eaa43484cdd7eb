"""The emulated reader on a TCP socket, in true time."""

import contextlib
import selectors
import socket
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from fleet.emulation.llrp.line import Line, LineFaults
from fleet.emulation.llrp.reader import EmulatedReader
from fleet.emulation.llrp.replies import OCCUPIED, error, greeting
from robot_agent.background import Background
from robot_agent.rfid.llrp.codec import Message, Undecodable, decode, encode, name_of
from robot_agent.rfid.llrp.frames import Frame, FramingError, Splitter
from tagmap.errors import LinkError

CHUNK_BYTES = 65536
LONGEST_SLEEP_S = 0.1
SEND_S = 1.0
"""A client that takes nothing for so long is let go."""


@dataclass(slots=True)
class _Client:
    socket: socket.socket
    address: str
    splitter: Splitter = field(default_factory=Splitter)
    line: Line = Line.OPEN


class LlrpServer(Background):
    """Serves one client at a time, and tells every other that it is not the one.

    `with LlrpServer(...) as server:` serves in a thread; `serve` does in the caller's. `tell` is
    given a line of text when a client comes, goes, or sends what makes no sense.
    """

    def __init__(
        self,
        reader: EmulatedReader,
        host: str = "127.0.0.1",
        port: int = 0,
        faults: LineFaults | None = None,
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Listens from now on; port 0 is any free one. Raises LinkError."""
        try:
            self._listener = socket.create_server((host, port))
        except (OSError, OverflowError) as cause:
            raise LinkError(f"cannot listen at {host}:{port}: {cause}") from None
        self._reader = reader
        self._faults = faults or LineFaults()
        self._tell = tell
        self._client: _Client | None = None
        super().__init__("llrp-server", self.serve)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)

    @property
    def address(self) -> tuple[str, int]:
        host, port = self._listener.getsockname()[:2]
        return host, port

    def serve(self) -> None:
        """Until the end of the context, or of the process."""
        try:
            while not self._stopping.is_set():
                for key, _ in self._selector.select(self._sleep_s()):
                    if key.fileobj is self._listener:
                        self._accept()
                    else:
                        self._read()
                self._send(self._reader.tick(time.time_ns()))
        finally:
            self._drop("the reader ends")
            self._selector.close()
            self._listener.close()

    def _sleep_s(self) -> float:
        due_ns = self._reader.due_ns()
        if due_ns is None:
            return LONGEST_SLEEP_S
        return min(max(0.0, (due_ns - time.time_ns()) * 1e-9), LONGEST_SLEEP_S)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            line, address = self._listener.accept()
            line.settimeout(SEND_S)
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self._client is not None:
                line.sendall(encode(greeting(OCCUPIED, time.time_ns())))
                line.close()
                return
            self._client = _Client(line, f"{address[0]}:{address[1]}")
            self._selector.register(line, selectors.EVENT_READ)
            self._tell(f"client {self._client.address} connected")
            self._send(self._reader.connected(time.time_ns()))

    def _read(self) -> None:
        client = self._client
        if client is None:
            return
        try:
            received = client.socket.recv(CHUNK_BYTES)
            for frame in client.splitter.feed(received):
                self._obey(frame)
                if self._client is not client:
                    return
        except FramingError as cause:
            self._drop(f"what it sends is not LLRP: {cause}")
        except OSError as cause:
            self._drop(cause.strerror or "the line broke")
        else:
            if not received:
                self._drop("it hung up")

    def _obey(self, frame: Frame) -> None:
        """No bytes may end the emulator, so what cannot be understood is answered and told."""
        try:
            message = decode(frame)
            message._validate()
        except (Undecodable, AssertionError, KeyError) as cause:
            self._tell(f"cannot understand: {cause}")
            self._send([error(frame.id, "M_ParameterError", str(cause))])
            return
        self._send(self._reader.receive(message, time.time_ns()))
        if name_of(message) == "CLOSE_CONNECTION":
            self._drop("it said goodbye")

    def _send(self, messages: Iterable[Message]) -> None:
        for message in messages:
            client = self._client
            if client is None or client.line is Line.MUTE:
                return
            content, client.line = self._faults.spoil(encode(message))
            try:
                client.socket.sendall(content)
            except OSError as cause:
                self._drop(cause.strerror or "it does not listen")
                return
            if client.line is Line.CUT:
                self._drop("the line was cut on purpose")

    def _drop(self, why: str) -> None:
        client, self._client = self._client, None
        if client is not None:
            self._selector.unregister(client.socket)
            client.socket.close()
            self._tell(f"client {client.address} is gone: {why}")
