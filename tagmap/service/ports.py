"""What the service needs around it; processes, threads and Zenoh, see run.py, are one way."""

from collections.abc import Callable
from typing import Any, Protocol

from tagmap.link.query import Query
from tagmap.mapping.draft import Arrival
from tagmap.service.archive import Lookup


class Sending(Protocol):
    """Where acknowledgements, poses, jobs and the map go out."""

    def put(self, key: str, payload: bytes) -> None: ...


class ServiceLink(Sending, Protocol):
    """What the service listens on as well; see tagmap.link.session.Link."""

    def subscribe(
        self, key_expr: str, on_sample: Callable[[str, bytes], None], capacity: int = ...
    ) -> None: ...

    def serve(self, key_expr: str, on_query: Callable[[Query], None]) -> None: ...

    def watch_alive(self, key_expr: str, on_change: Callable[[str, bool], None]) -> None: ...


class Receiving(Protocol):
    """Where what arrived waits to be taken; see tagmap.service.inbox.Inbox."""

    def put_arrival(self, arrival: Arrival) -> None: ...

    def put(self, event: Any) -> None: ...

    def take(self, at_most: int, timeout_s: float) -> tuple[list[Any], list[Arrival]]: ...


class Solver(Protocol):
    """See tagmap.service.solver.SolverProcess."""

    @property
    def pid(self) -> int | None:
        """Of its process, where it has one."""
        ...

    def order(self, from_nothing: bool = False) -> None:
        """Have everything that is committed now taken in; a Solved or Failed event will follow."""
        ...

    def stop(self) -> None: ...


class Answering(Protocol):
    """Answers from the database, at once or later; see tagmap.service.archive.Archive."""

    def ask(self, query: Query, lookup: Lookup) -> None: ...
