"""The real service, its database and its solver in one process and in a time of its own."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Self

from tagmap.clock import Clock
from tagmap.link.keys import Keys
from tagmap.link.query import Query
from tagmap.living.begin import begin
from tagmap.mapping.draft import Arrival
from tagmap.records import AdminReply, AdminRequest, decode, encode
from tagmap.service.inbox import Inbox
from tagmap.service.mapmaker import Mapmaker
from tagmap.service.memories import JobAnswer
from tagmap.service.shell import Service
from tagmap.service.solver import Failed
from tagmap.store import Keep, SiteStore
from tagmap.writeback.wanted import Owner

START_NS = 1_770_000_000_000_000_000
TURN_NS = 10_000_000_000
MOST_TURNS = 20


class Indoors:
    """`heard`: what the service put, as (key, payload). A turn is followed by ten seconds, so that
    whatever is due is done in the next one."""

    def __init__(self, path: Path, owner: Owner) -> None:
        self.path, self.now_ns = path, START_NS
        self.keys = Keys("site")
        self.heard: list[tuple[str, bytes]] = []
        self._start(owner)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.service.store.close()
        self._reader.close()

    def restart(self, owner: Owner) -> None:
        """As after a kill: what was committed is all there is."""
        self.__exit__()
        self._start(owner)

    def put(self, key: str, payload: bytes) -> None:
        self.heard.append((key, payload))

    def send(self, robot: str, messages: Iterable[Any]) -> None:
        for message in messages:
            self.inbox.put_arrival(Arrival(robot, encode(message)))
        self.settle()

    def answer_job(self, robot: str, result: Any) -> None:
        self.inbox.put(JobAnswer(robot, encode(result)))
        self.settle()

    def admin(self, noun: str, verb: str, **args: Any) -> Any:
        asker = _Asker()
        key = self.keys.admin(noun, verb)
        self.inbox.put(Query(key, {}, encode(AdminRequest(args=args)), asker))
        self.settle()
        reply = decode(AdminReply, asker.payload, 2**26)
        assert reply.error is None, reply.error
        return reply.data

    def settle(self) -> None:
        """Turn until everything that arrived is in the map."""
        for _ in range(MOST_TURNS):
            self.turn()
            cadence = self.service.solving.cadence
            if cadence.solved >= cadence.have and self.service.broken_until_s is None:
                return
        raise AssertionError(f"{cadence} after {MOST_TURNS} turns")

    def turn(self) -> None:
        self.service.turn(0.0)
        self.now_ns += TURN_NS

    def _start(self, owner: Owner) -> None:
        self.inbox = Inbox(2048)
        store = SiteStore.open(self.path, "site")
        self._reader = SiteStore.open(self.path, "site", read_only=True)
        mapmaker = Mapmaker(self._reader, begin, lambda: 0.0)
        clock = Clock(lambda: self.now_ns, lambda: self.now_ns)
        solver, desk = _Solver(mapmaker, self.inbox.put), _Archive(self._reader)
        keep = Keep(None, None)
        self.service = Service(store, self, None, solver, desk, self.inbox, owner, keep, clock)


class _Asker:
    payload = b""

    def answer(self, answers: Iterable[tuple[str, bytes]]) -> bool:
        ((_, self.payload),) = answers
        return True

    def refuse(self, text: str) -> bool:
        raise AssertionError(text)

    def leave(self) -> None:
        raise AssertionError("left without a word")


class _Solver:
    pid = None

    def __init__(self, mapmaker: Mapmaker, on_result: Callable[[Any], None]) -> None:
        self._mapmaker, self._on_result = mapmaker, on_result

    def order(self, from_nothing: bool = False) -> None:
        try:
            self._on_result(self._mapmaker.solve(from_nothing))
        except Exception as error:
            self._on_result(Failed(f"{type(error).__name__}: {error}"))

    def stop(self) -> None:
        pass


class _Archive:
    def __init__(self, store: SiteStore) -> None:
        self._store = store

    def ask(self, query: Query, lookup: Callable[[SiteStore], Any]) -> None:
        query.reply_many(lookup(self._store))
