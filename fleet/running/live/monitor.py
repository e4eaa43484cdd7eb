"""Hears everything that goes over the wire of a site, and when it came."""

import time
from contextlib import ExitStack
from types import TracebackType
from typing import Self

from fleet.running.tape import Tape
from tagmap.link.keys import Keys
from tagmap.link.session import Link

WAIT_S = 30.0
WAITING = 16_384
"""So many messages may wait to be recorded."""


class Monitor:
    """`with Monitor(endpoint, site, tape):` a client of the router like any other."""

    def __init__(self, endpoint: str, site: str, tape: Tape) -> None:
        self._endpoint, self._root, self._tape = endpoint, Keys(site).root, tape
        self._opened = ExitStack()

    def __enter__(self) -> Self:
        """Raises LinkError when there is no router."""
        link = self._opened.enter_context(Link.open([self._endpoint], wait_s=WAIT_S))
        link.subscribe(f"{self._root}/**", self._hear, capacity=WAITING)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._opened.close()

    def _hear(self, key: str, payload: bytes) -> None:
        self._tape.hear(time.time_ns(), key, payload)
