"""One declared entity with its own ring and its own thread.

A callback given to Zenoh directly stops the whole session while it runs; a ring drops its oldest
entries instead, and everything else flows on.
"""

import threading
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import structlog
import zenoh

T = TypeVar("T")


class Declared(Protocol):
    """A subscriber, queryable or listener that was declared with a channel."""

    @property
    def handler(self) -> Any: ...

    def undeclare(self) -> Any: ...


class Receiver:
    """Calls `handle` with everything that arrives, in its own thread, until closed."""

    def __init__(self, declared: Declared, handle: Callable[[Any], None], name: str) -> None:
        self._declared = declared
        self._handle = handle
        # A daemon, so that a program which forgets to close its link gets as far as atexit.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def undeclare(self) -> None:
        self._declared.undeclare()

    def join(self, timeout_s: float) -> None:
        if self._thread is not threading.current_thread():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        # Receiving on the entity itself would make undeclare() fail in the other thread.
        channel = self._declared.handler
        while True:
            try:
                item = channel.recv()
            except zenoh.ZError:
                return
            try:
                self._handle(item)
            except Exception:
                structlog.get_logger("link").exception("handler failed", entity=self._thread.name)
            del item  # a query that stays in this variable would never end for its asker
