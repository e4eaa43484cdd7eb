"""An LLRP reader as the agent knows readers."""

import re
import socket
import threading
import time
from collections.abc import Callable, Sequence
from itertools import count
from typing import Annotated, TypeAlias, TypeVar

import msgspec
from msgspec import Meta

from robot_agent.backoff import Backoff
from robot_agent.rfid.llrp import outcome, requests
from robot_agent.rfid.llrp.codec import Message, llrp
from robot_agent.rfid.llrp.connection import Connection, ConnectionLost, Refused
from robot_agent.rfid.llrp.reports import Fact, Sighting, WindowEvent, connection_status, facts
from robot_agent.rfid.reader import Failure, Inventory, ReaderInfo, Reason, RfidReader, UserWords

T = TypeVar("T")

PORT = 5084
OVERTIME_S = 0.25
"""How much later than asked a reader may end a window before it is told to."""
ADDRESSES = 1 << 16
WORD_S = 0.02
"""A tag may take as long to write a word (EPC Gen2, 6.3.2.12.3.3)."""
SILENT_KEEPALIVES = 3
EPC = re.compile(r"([0-9a-f]{4}){1,31}")


AntennaNumber: TypeAlias = Annotated[int, Meta(ge=0, le=65535)]
Patience: TypeAlias = Annotated[float, Meta(ge=0.05, le=600.0)]


class LlrpConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the reader is and how patient to be with it. antennas: 0 is all of them."""

    host: str
    port: Annotated[int, Meta(ge=1, le=65535)] = PORT
    antennas: Annotated[tuple[AntennaNumber, ...], Meta(min_length=1)] = (0,)
    connect_s: Patience = 2.0
    answer_s: Patience = 2.0
    keepalive_s: Patience = 1.0


class LlrpReader(RfidReader):
    """RfidReader by LLRP. Connects when it is first asked for something, again whenever the
    connection was lost, and waits longer from failure to failure: a call in between says so at
    once. Raises LlrpUnavailable at construction when pyllrp is not installed.
    """

    def __init__(self, config: LlrpConfig) -> None:
        llrp()
        self._config = config
        self._address = f"{config.host}:{config.port}"
        self._connection: Connection | None = None
        self._backoff = Backoff()
        self._ids = count(1)
        self._one_at_a_time = threading.Lock()

    def probe(self) -> ReaderInfo | Failure:
        def ask(connection: Connection) -> ReaderInfo | Failure:
            [answer] = connection.ask([requests.ask_capabilities()], self._config.answer_s)
            return outcome.reader_info(self._address, answer)

        return self._attempt(ask)

    def inventory(self, window_s: float) -> Inventory | Failure:
        def listen(connection: Connection) -> Inventory:
            started_ns = time.time_ns()
            found = self._window(connection, next(self._ids), window_s, lambda _: False)
            return outcome.inventory(found, started_ns, time.time_ns())

        return self._attempt(listen)

    def read_user(
        self, epc: str, start: int, count: int | None, timeout_s: float
    ) -> UserWords | Failure:
        epc = epc.lower()
        wrong = _wrong(epc, start, count, ())
        if wrong:
            return Failure("bad_request", wrong)

        def read(connection: Connection) -> UserWords | Failure:
            command = requests.read_command(start, count or 0)
            found = self._access(connection, epc, [command], timeout_s)
            return outcome.read(found, epc, start, count, timeout_s)

        return self._attempt(read)

    def write_user(
        self, epc: str, start: int, words: tuple[int, ...], timeout_s: float
    ) -> UserWords | Failure:
        epc = epc.lower()
        wrong = _wrong(epc, start, len(words), words)
        if wrong:
            return Failure("bad_request", wrong)

        def write(connection: Connection) -> UserWords | Failure:
            commands = [
                requests.write_command(start, words),
                requests.read_command(start, len(words)),
            ]
            overtime_s = len(words) * WORD_S
            found = self._access(connection, epc, commands, timeout_s, overtime_s)
            return outcome.written(found, epc, start, words, timeout_s)

        return self._attempt(write)

    def close(self) -> None:
        with self._one_at_a_time:
            self._hang_up()

    def _attempt(self, operation: Callable[[Connection], T]) -> T | Failure:
        """The one place where the line's troubles become failures."""
        with self._one_at_a_time:
            try:
                result = operation(self._connected())
            except Waiting as error:
                return self._failure("reader_gone", error)
            except ConnectionLost as error:
                self._backoff.failed(time.monotonic())
                return self._failure("reader_gone", error)
            except Refused as error:
                # Whatever half a request left in the reader goes when the next connection opens.
                self._hang_up()
                return self._failure("reader_error", error)
            self._backoff.succeeded()
            return result

    def _failure(self, reason: Reason, error: Exception) -> Failure:
        return Failure(reason, f"reader {self._address}: {error}")

    def _window(
        self,
        connection: Connection,
        window: int,
        window_s: float,
        is_enough: Callable[[Fact], bool],
        overtime_s: float = 0.0,
    ) -> list[Fact]:
        """All that is reported of a window. The reader ends it, else it is ended here."""
        config = self._config
        connection.ask(requests.open_window(window, window_s, config.antennas), config.answer_s)
        deadline = time.monotonic() + window_s + OVERTIME_S + overtime_s
        found: list[Fact] = []
        while (message := connection.receive(deadline)) is not None:
            news = facts(message, window)
            found += news
            if any(_is_end(fact) or is_enough(fact) for fact in news):
                break
        connection.ask(requests.forget_everything(), config.answer_s, insist=False)
        while (message := connection.receive(0.0)) is not None:
            found += facts(message, window)
        return found

    def _access(
        self,
        connection: Connection,
        epc: str,
        commands: Sequence[Message],
        timeout_s: float,
        overtime_s: float = 0.0,
    ) -> list[Fact]:
        id = next(self._ids)
        connection.ask(requests.prepare_access(id, id, epc, commands), self._config.answer_s)
        return self._window(connection, id, timeout_s, _is_result, overtime_s)

    def _connected(self) -> Connection:
        if self._connection is not None and self._connection.lost is None:
            self._connection.forget()
            return self._connection
        self._hang_up()
        wait_s = self._backoff.wait_s(time.monotonic())
        if wait_s > 0.0:
            raise Waiting(f"no connection, the next try is in {wait_s:.1f} s")
        self._connection = self._open()
        return self._connection

    def _open(self) -> Connection:
        config = self._config
        try:
            line = socket.create_connection((config.host, config.port), config.connect_s)
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except (OSError, ValueError, OverflowError) as error:
            why = getattr(error, "strerror", None) or error
            raise ConnectionLost(f"cannot connect: {why}") from None
        connection = Connection(line, SILENT_KEEPALIVES * config.keepalive_s)
        try:
            _await_greeting(connection, config.connect_s)
            # Some readers refuse to delete where there is nothing.
            connection.ask(requests.forget_everything(), config.answer_s, insist=False)
            connection.ask([requests.configure(config.keepalive_s)], config.answer_s)
        except (ConnectionLost, Refused) as error:
            connection.close()
            raise ConnectionLost(str(error)) from None
        return connection

    def _hang_up(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None


class Waiting(ConnectionLost):
    """It is too early to try again."""


def _await_greeting(connection: Connection, timeout_s: float) -> None:
    """A reader serves one client, and tells every other that it is not the one."""
    deadline = time.monotonic() + timeout_s
    while (message := connection.receive(deadline)) is not None:
        status = connection_status(message)
        if status == 0:
            return
        if status is not None:
            name = llrp().ConnectionAttemptStatusType.getName(status).replace("_", " ")
            raise ConnectionLost(f"the reader turned this client away: {name}")
    raise ConnectionLost(f"connected, but no LLRP greeting within {timeout_s:g} s")


def _is_end(fact: Fact) -> bool:
    return isinstance(fact, WindowEvent) and fact.ended


def _is_result(fact: Fact) -> bool:
    return isinstance(fact, Sighting) and (fact.read is not None or fact.written is not None)


def _wrong(epc: str, start: int, count: int | None, words: tuple[int, ...]) -> str | None:
    """What is wrong with a request; None: nothing. A tag may be known by a name that is no EPC."""
    if not EPC.fullmatch(epc):
        return f"{epc[:80]!r} is no EPC, expected 4 to 124 hex digits, a multiple of 4"
    end = start + (count or 0)
    if start < 0 or end > ADDRESSES or (count is not None and count < 1):
        return f"{count} words from {start}, expected at least 1 within 0 to {ADDRESSES - 1}"
    bad = next((word for word in words if not 0 <= word < ADDRESSES), None)
    return None if bad is None else f"word {bad}, expected 0 to 65535"
