"""The map service as one life in virtual time: the same service, a real database."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from fleet.virtual.bus import Bus
from fleet.virtual.inbox import VirtualInbox
from fleet.virtual.port import Killed, Moment
from fleet.virtual.solver import SolveTime, VirtualSolver
from fleet.virtual.virtual_time import VirtualTime
from fleet.virtual.volume import Remains, Volume
from tagmap.clock import Clock
from tagmap.link.keys import Keys
from tagmap.link.query import Query
from tagmap.mapping.surveying import SurveyedPosition
from tagmap.service.archive import Lookup, answer
from tagmap.service.listening import listen
from tagmap.service.shell import TURN_S, Service
from tagmap.store import Keep, SiteStore
from tagmap.writeback.wanted import Owner

SERVICE = "service"


@dataclass(frozen=True, slots=True)
class Kill:
    """A process dies at `at_ns`, or when `moment` comes after that, and is started again after
    `down_s`."""

    at_ns: int
    down_s: float = 1.0
    moment: Moment = "waiting"


@dataclass(frozen=True, slots=True)
class FullDisk:
    """The database cannot grow from the one until the other."""

    from_ns: int
    until_ns: int


class VirtualSite:
    """`live` is its life; it ends after `stop`. The database is `db`."""

    def __init__(
        self,
        folder: Path,
        time: VirtualTime,
        bus: Bus,
        *,
        site: str = "site",
        surveys: Sequence[SurveyedPosition] = (),
        owner: Owner | None = None,
        keep: Keep | None = None,
        solve_time: SolveTime | None = None,
        kills: Iterable[Kill] = (),
        full: Sequence[FullDisk] = (),
    ) -> None:
        self.db, self.site, self.keys = folder / "site.db", site, Keys(site)
        self.starts = 0
        self._time, self._bus = time, bus
        self._surveys, self._owner = list(surveys), owner or Owner(None)
        self._keep, self._solve_time = keep or Keep(), solve_time or SolveTime()
        self._kills, self._full = sorted(kills, key=lambda kill: kill.at_ns), full
        self._stopping = False

    def live(self) -> None:
        while not self._stopping:
            kill = next((k for k in self._kills if k.at_ns >= self._time.now_ns()), None)
            remains = Remains(self.db)
            try:
                self._serve(kill, remains)
            except Killed:
                assert kill is not None
                remains.lay_out()
                self._kills.remove(kill)
                self._time.wait_ns(round(kill.down_s * 1e9))

    def stop(self) -> None:
        """After the turn that is under way."""
        self._stopping = True

    def run(self, lives: Iterable[Callable[[], None]]) -> None:
        """These lives, and the site as long as one of them goes on."""
        going = list(lives)
        left = len(going)

        def counted(live: Callable[[], None]) -> None:
            nonlocal left
            try:
                live()
            finally:
                left -= 1
                if left == 0:
                    self.stop()

        self._time.run([self.live, *(lambda live=live: counted(live) for live in going)])

    def _serve(self, kill: Kill | None, remains: Remains) -> None:
        """One process of the service, from its start to its end."""
        with ExitStack() as opened:
            store = opened.enter_context(Volume.open(self.db, self.site))
            reader = opened.enter_context(SiteStore.open(self.db, self.site, read_only=True))
            port = self._bus.port(SERVICE)
            opened.callback(port.close)
            port.at_death(remains.take)
            if kill is not None:
                port.kill_at(kill.at_ns, kill.moment)
            inbox = VirtualInbox(port)
            solver = VirtualSolver(self.db, self.site, port, inbox.put, self._solve_time)
            opened.callback(solver.stop)
            clock = Clock(self._time.now_ns, self._time.now_ns)
            service = Service(
                store, port, None, solver, _Reader(reader), inbox, self._owner, self._keep, clock
            )
            service.survey(self._surveys)
            listen(port, self.keys, inbox)
            self.starts += 1
            while not self._stopping:
                self._mind_the_disk(store)
                service.turn(TURN_S)
            service.stop()

    def _mind_the_disk(self, store: Volume) -> None:
        now_ns = self._time.now_ns()
        is_full = any(full.from_ns <= now_ns < full.until_ns for full in self._full)
        if is_full != store.is_full:
            (store.fill if is_full else store.make_room)()


@dataclass(frozen=True, slots=True)
class _Reader:
    """Long answers, given at once: they take no time."""

    store: SiteStore

    def ask(self, query: Query, lookup: Lookup) -> None:
        answer(query, lookup, self.store)
