"""A program's connection to the site's routers.

    with Link.open(["tcp/127.0.0.1:7447"], wait_s=5.0) as link:
        link.subscribe(keys.keyframes(), inbox.put)
        link.put(keys.ack("r1"), encode(ack))

After `open` has succeeded the link reconnects for ever by itself and re-declares everything.
While no router is there a put is lost and a get answers nothing: "empty" means unavailable.
Callbacks run in the link's threads, one per declaration: they enqueue, and return.
"""

import atexit
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import zenoh
from zenoh.handlers import RingChannel

from tagmap.errors import LinkError
from tagmap.link.asking import ENCODING, query_from, reply_from
from tagmap.link.config import client_config, endpoints_of, one_line, tls_of
from tagmap.link.diagnosis import why_unreachable
from tagmap.link.query import Query, Reply
from tagmap.link.receiver import Declared, Receiver

RETRY_S = 0.25
JOIN_S = 2.0


def _never() -> bool:
    return False


def _ignore(_reason: str) -> None:
    pass


@contextmanager
def _told(about: str) -> Iterator[None]:
    """Zenoh's errors, of a bad key or a closed session, as ours."""
    try:
        yield
    except zenoh.ZError as error:
        raise LinkError(f"{about}: {one_line(error)}") from None


def _why_not_open(config: zenoh.Config) -> str:
    endpoints = endpoints_of(config)
    reasons = (f"{endpoint}: {why_unreachable(endpoint, tls_of(config))}" for endpoint in endpoints)
    return f"no router at {'; '.join(reasons)}"


class Link:
    """Make one with `open`. All methods may be called from any thread."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._receivers: list[Receiver] = []
        self._tokens: list[zenoh.LivelinessToken] = []
        # The interpreter cannot end cleanly while our threads wait inside Zenoh.
        atexit.register(self.close)

    @classmethod
    def open(
        cls,
        endpoints: Sequence[str] = (),
        *,
        zenoh_config: Path | None = None,
        wait_s: float | None = 0.0,
        stopped: Callable[[], bool] = _never,
        on_waiting: Callable[[str], None] = _ignore,
    ) -> Self:
        """Connect as a client to one of the routers at `endpoints`, or as `zenoh_config` says
        (then endpoints, when given, replace the file's).

        Tries again for `wait_s` (None: for ever) or until `stopped()`; tells `on_waiting` the
        reason whenever it changes. Raises LinkError, naming the endpoints and the reason.
        """
        config = client_config(endpoints, zenoh_config)
        deadline = None if wait_s is None else time.monotonic() + wait_s
        told = ""
        while True:
            try:
                return cls(zenoh.open(config))
            except zenoh.ZError:
                reason = _why_not_open(config)
            if stopped() or (deadline is not None and time.monotonic() >= deadline):
                raise LinkError(reason)
            if reason != told:
                on_waiting(reason)
                told = reason
            time.sleep(RETRY_S)

    def put(self, key: str, payload: bytes) -> None:
        """Send and forget; dropped without a word when no router is there or the way is jammed."""
        with _told(key):
            self._session.put(
                key, payload, encoding=ENCODING, congestion_control=zenoh.CongestionControl.DROP
            )

    def subscribe(
        self, key_expr: str, on_sample: Callable[[str, bytes], None], capacity: int = 1024
    ) -> None:
        """Call `on_sample(key, payload)` for every put; beyond `capacity` waiting, oldest drop."""

        def handle(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                on_sample(str(sample.key_expr), sample.payload.to_bytes())

        channel: RingChannel[zenoh.Sample] = RingChannel(capacity)
        with _told(key_expr):
            declared = self._session.declare_subscriber(key_expr, channel)
        self._receive(declared, handle, key_expr)

    def serve(self, key_expr: str, on_query: Callable[[Query], None], capacity: int = 256) -> None:
        """Call `on_query` for every question; beyond `capacity` waiting, oldest drop."""

        def handle(query: zenoh.Query) -> None:
            on_query(query_from(query))

        channel: RingChannel[zenoh.Query] = RingChannel(capacity)
        with _told(key_expr):
            declared = self._session.declare_queryable(key_expr, channel)
        self._receive(declared, handle, key_expr)

    def get(
        self, selector: str, payload: bytes | None = None, *, timeout_s: float = 5.0
    ) -> list[Reply]:
        """Ask `key?name=value;name=value` and wait for all answers. An empty list means that
        nobody could be asked, never that there is nothing."""
        encoding = None if payload is None else ENCODING
        with _told(selector):
            replies = self._session.get(
                selector, payload=payload, encoding=encoding, timeout=timeout_s
            )
        return [reply_from(reply) for reply in replies]

    def ask(
        self, selector: str, payload: bytes | None = None, *, timeout_s: float = 5.0
    ) -> list[Reply]:
        """`get`, repeated until somebody answers. LinkError when nobody does in `timeout_s`."""
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0:
            replies = self.get(selector, payload, timeout_s=left)
            if any(reply.error != "Timeout" for reply in replies):
                return replies
            time.sleep(min(RETRY_S, max(left, 0.0)))
        raise LinkError(f"no answer to {selector} within {timeout_s:g} s")

    def declare_alive(self, key: str) -> None:
        """Hold a liveliness token at `key` until closed; it vanishes when this process dies."""
        with _told(key):
            self._tokens.append(self._session.liveliness().declare_token(key))

    def watch_alive(self, key_expr: str, on_change: Callable[[str, bool], None]) -> None:
        """Call `on_change(key, alive)` for every token there is now and every later change."""
        held: set[str] = set()

        def handle(sample: zenoh.Sample) -> None:
            key, alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
            if alive == (key in held):
                return  # routers repeat themselves when a watch and a token meet
            (held.add if alive else held.discard)(key)
            on_change(key, alive)

        channel: RingChannel[zenoh.Sample] = RingChannel(4096)
        with _told(key_expr):
            liveliness = self._session.liveliness()
            declared = liveliness.declare_subscriber(key_expr, channel, history=True)
        self._receive(declared, handle, key_expr)

    def alive(self, key_expr: str, *, timeout_s: float = 2.0) -> list[str]:
        """Keys of the tokens held now, sorted: one look, which may miss some for a moment after
        they were declared, and any on a link that also watches them. `watch_alive` misses none."""
        with _told(key_expr):
            replies = self._session.liveliness().get(key_expr, timeout=timeout_s)
        return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)

    def connected(self) -> bool:
        """Whether a router is there now."""
        return bool(self._session.info.routers_zid())

    def on_connected(self, callback: Callable[[], None]) -> None:
        """Call `callback` now and whenever a router has been found again after a loss."""

        def handle(event: zenoh.TransportEvent) -> None:
            if event.kind == zenoh.SampleKind.PUT:
                callback()

        channel: RingChannel[zenoh.TransportEvent] = RingChannel(64)
        with _told("connection"):
            listener = self._session.info.declare_transport_events_listener(channel, history=True)
        self._receive(listener, handle, "connection")

    def close(self) -> None:
        """Undeclare everything, then leave; nothing is called any more. May be repeated."""
        tokens, self._tokens = self._tokens, []
        receivers, self._receivers = self._receivers, []
        for token in tokens:
            token.undeclare()  # type: ignore[no-untyped-call]
        for receiver in receivers:
            receiver.undeclare()
        if not self._session.is_closed():
            self._session.close()  # type: ignore[no-untyped-call]
        for receiver in receivers:
            receiver.join(JOIN_S)
        atexit.unregister(self.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _receive(self, declared: Declared, handle: Callable[[Any], None], name: str) -> None:
        self._receivers.append(Receiver(declared, handle, f"link {name}"))
