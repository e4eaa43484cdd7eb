"""One TCP connection to a reader. A thread listens, so that keepalives are answered in time."""

import contextlib
import queue
import socket
import threading
import time
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robot_agent.rfid.llrp.codec import Message, Undecodable, decode, encode, llrp, name_of
from robot_agent.rfid.llrp.frames import Frame, FramingError, Splitter
from robot_agent.rfid.llrp.reports import refusal

CHUNK_BYTES = 65536
WAITING_MESSAGES = 1000
"""Nobody collects what arrives between two calls: beyond these it is dropped."""
GOODBYE_S = 0.5


class ConnectionLost(Exception):
    """There is no connection any more, or the reader does not answer. Says why."""


class Refused(Exception):
    """The reader answered that it will not, or its answer makes no sense. Says which and why."""


@dataclass(frozen=True, slots=True)
class Broken:
    """A message of this type and id arrived that cannot be decoded."""

    kind: int
    id: int
    why: str


class Connection:
    """Send, wait for answers, collect reports. Raises ConnectionLost and Refused, nothing else."""

    def __init__(self, line: socket.socket, silence_s: float) -> None:
        """The line counts as lost after `silence_s` without a byte: keepalives come more often."""
        self._line = line
        self._line.settimeout(silence_s)
        self._silence_s = silence_s
        self._inbox: queue.Queue[Message | Broken | None] = queue.Queue(WAITING_MESSAGES)
        self._kept: deque[Message] = deque(maxlen=WAITING_MESSAGES)
        self._lost: str | None = None
        self._sending = threading.Lock()
        self._thread = threading.Thread(target=self._listen, name="llrp", daemon=True)
        self._thread.start()

    @property
    def lost(self) -> str | None:
        """Why the connection is gone; None while it stands."""
        return self._lost

    def ask(
        self, requests: Sequence[Message], timeout_s: float, *, insist: bool = True
    ) -> list[Message]:
        """Send all and wait for the answers, which come back in the order of arrival. What
        arrives beside them is kept for `receive`. Raises Refused only if it is to `insist`."""
        open_ids = {request.MessageID: request for request in requests}
        deadline = time.monotonic() + timeout_s
        answers: list[Message] = []
        self._send(*requests)
        while open_ids:
            message = self._next(deadline)
            if message is None:
                raise ConnectionLost(self._lose(_silence(open_ids.values(), timeout_s)))
            if _is_answer(message, open_ids):
                answers.append(message)
                why = _refusal(message, open_ids)
                if why is not None and insist:
                    raise Refused(why)
            elif not isinstance(message, Broken):
                self._kept.append(message)
        return answers

    def receive(self, deadline: float) -> Message | None:
        """The next message that answers nothing; None at `deadline`, of time.monotonic()."""
        if self._kept:
            return self._kept.popleft()
        while isinstance(message := self._next(deadline), Broken):
            pass
        return message

    def forget(self) -> None:
        """Drop what has arrived up to now."""
        self._kept.clear()
        while not self._inbox.empty():
            self._inbox.get_nowait()

    def close(self) -> None:
        if self._lost is None:
            with contextlib.suppress(ConnectionLost, Refused):
                self.ask([llrp().CLOSE_CONNECTION_Message()], GOODBYE_S)
        self._lose("closed")
        self._thread.join(timeout=2.0)

    def _send(self, *messages: Message) -> None:
        content = b"".join(map(encode, messages))
        try:
            with self._sending:
                self._line.sendall(content)
        except OSError as error:
            raise ConnectionLost(self._lose(f"cannot send: {_why(error)}")) from None

    def _next(self, deadline: float) -> Message | Broken | None:
        """What arrived before the connection was lost is still delivered."""
        while True:
            if self._lost is not None and self._inbox.empty():
                raise ConnectionLost(self._lost)
            try:
                message = self._inbox.get(timeout=max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                return None
            if message is not None:
                return message

    def _listen(self) -> None:
        splitter = Splitter()
        try:
            while self._lost is None:
                received = self._line.recv(CHUNK_BYTES)
                if not received:
                    self._lose("the reader closed the connection")
                for frame in splitter.feed(received):
                    self._arrived(frame)
        except TimeoutError:
            self._lose(f"not a byte for {self._silence_s:g} s, not even a keepalive")
        except FramingError as error:
            self._lose(f"what arrived is not LLRP: {error}")
        except ConnectionLost:
            pass
        except OSError as error:
            self._lose(_why(error))
        except Exception as error:
            # A thread that ends unheard would look like a silent reader.
            self._lose(f"{type(error).__name__}: {error}")

    def _arrived(self, frame: Frame) -> None:
        message: Message | Broken
        try:
            message = decode(frame)
        except Undecodable as error:
            message = Broken(frame.kind, frame.id, str(error))
        if not isinstance(message, Broken) and name_of(message) == "KEEPALIVE":
            self._send(llrp().KEEPALIVE_ACK_Message(MessageID=frame.id))
            return
        try:
            self._inbox.put_nowait(message)
        except queue.Full:
            return

    def _lose(self, why: str) -> str:
        """Only the first reason counts. Wakes whoever waits."""
        if self._lost is None:
            self._lost = why
            with contextlib.suppress(OSError):
                self._line.shutdown(socket.SHUT_RDWR)
            self._line.close()
            if not self._inbox.full():
                self._inbox.put_nowait(None)
        return self._lost


def _is_answer(message: Message | Broken, requests: dict[int, Message]) -> bool:
    """A reader numbers its reports as it likes, so the type must agree as well."""
    p = llrp()
    kind, id = (
        (message.kind, message.id)
        if isinstance(message, Broken)
        else (message.TypeCode, message.MessageID)
    )
    if id not in requests:
        return False
    return kind in (p.GetResponseClass(requests[id]).TypeCode, p.ERROR_MESSAGE_Message.TypeCode)


def _refusal(answer: Message | Broken, requests: dict[int, Message]) -> str | None:
    """Why an answer is no yes. Its request is taken off the list."""
    if isinstance(answer, Broken):
        return f"the answer to {name_of(requests.pop(answer.id))} is broken: {answer.why}"
    request, why = requests.pop(answer.MessageID), refusal(answer)
    return why and f"{name_of(request)} was refused: {why}"


def _silence(requests: Iterable[Message], timeout_s: float) -> str:
    names = ", ".join(map(name_of, requests))
    return f"no answer to {names} within {timeout_s:g} s"


def _why(error: OSError) -> str:
    return error.strerror or str(error) or type(error).__name__
