"""The loop that owns the state: takes what arrived, has the mapper judge it, commits, and tells.

Nothing is acknowledged before it is on the disk. When a commit fails the mapper is ahead of the
database: it is thrown away and restored from there, and the robots send again.
"""

import threading
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

import structlog

from tagmap.clock import Clock
from tagmap.errors import LinkError, StoreError, TagmapError
from tagmap.link.keys import Keys
from tagmap.link.query import Query
from tagmap.link.router import RouterProcess
from tagmap.mapper import Adoption, Mapper, Outcome
from tagmap.mapping.draft import Arrival
from tagmap.mapping.surveying import SurveyedPosition, surveyed
from tagmap.records import encode
from tagmap.service.admin import Args, flag
from tagmap.service.desk import Desk
from tagmap.service.leasing import Leasing
from tagmap.service.memories import JobAnswer, Memories
from tagmap.service.ports import Answering, Receiving, Sending, Solver
from tagmap.service.restore import remembered, restore
from tagmap.service.solver import Failed, Solved
from tagmap.service.solving import Solving
from tagmap.service.throttle import Throttle
from tagmap.store import Batch, Keep, Reading, RefusalRow, SiteStore, Survey
from tagmap.writeback.wanted import Owner

BATCH = 512
TURN_S = 0.1
ROUTER_CHECK_S = 0.5
LET_GO_S = 2.0
RETRY_S = 1.0
NAMED = 10


@dataclass(frozen=True, slots=True)
class Presence:
    robot: str
    alive: bool


class Service:
    """Everything here runs in the thread that calls `run`, or `turn` again and again."""

    def __init__(
        self,
        store: SiteStore,
        link: Sending,
        router: RouterProcess | None,
        solver: Solver,
        archive: Answering,
        inbox: Receiving,
        owner: Owner,
        keep: Keep,
        clock: Clock | None = None,
    ) -> None:
        self.clock = clock or Clock()
        self.keep = keep
        self.store, self.link, self.router, self.inbox = store, link, router, inbox
        self.keys = Keys(store.site)
        self.log = structlog.get_logger("service")
        self.throttle = Throttle()
        self.leasing = Leasing(self.clock)
        self.mapper: Mapper = self._restored()
        self.memories = Memories(store, link, self.keys, owner, self.clock)
        self.desk = Desk(self.keys, self.mapper, archive, self.leasing, self.memories)
        self.desk.commands[("site", "status")] = self._status
        self.desk.commands[("tags", "survey")] = self._survey_one
        self.desk.commands[("tags", "memory")] = self._list_memories
        self.desk.commands[("map", "solve")] = self._solve
        self.solving = Solving(store, solver, self.desk, self.clock)
        self.broken_until_s: float | None = None
        self.complained = False
        self.router_check_s = 0.0
        self.let_go_s = 0.0

    def run(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            self.turn(TURN_S)
        self.stop()

    def turn(self, wait_s: float) -> None:
        """Do what there is to do; waits up to `wait_s` for something to arrive."""
        in_a_hurry = self.mapper.is_behind and self.broken_until_s is None
        events, arrivals = self.inbox.take(BATCH, 0.0 if in_a_hurry else wait_s)
        for event in events:
            if not self._do(self._handle, event):
                self._turn_away(event)
        self._do(self._ingest, arrivals)
        self._do(self._remember)
        self._do(self._follow)
        self._do(self.solving.tick)
        self._do(self._write_back)
        self._do(self._let_go)
        self._keep_router()
        self._report_flood()

    def stop(self) -> None:
        """After the last turn."""
        self.solving.turn_away("the service stops")

    def _do(self, act: Callable[..., None], *arguments: Any) -> bool:
        """Once something broke, nothing more is told of a state that is not in the database."""
        if not self._is_sound():
            return False
        try:
            act(*arguments)
        except Exception as error:
            self._break(error)
        return True

    def survey(self, positions: Iterable[SurveyedPosition]) -> int:
        """Store what is new among `positions`; returns how many that were."""
        told = self.mapper.surveys.told
        new = [p for p in positions if told.get(p.tag) != p]
        if new:
            rows = [Survey(p.tag, p.p_m, p.sigma_m, self.clock.utc_ns()) for p in new]
            self.store.commit(Batch(surveys=rows))
            told.update({p.tag: p for p in new})
            self._resolve()
            self.log.info("surveyed", count=len(new), tags=[p.tag for p in new[:NAMED]])
        return len(new)

    def _remember(self) -> None:
        """What the tags' own memories say people surveyed, where that is news."""
        news = self.memories.news(self.mapper.surveys)
        if not news:
            return
        before = self.mapper.surveys.in_force
        self.store.commit(Batch(memory_surveys=news))
        self.mapper.surveys.remembered = remembered(self.store)
        after = self.mapper.surveys.in_force
        tags = [one.tag for one in news if before.get(one.tag) != after.get(one.tag)]
        if tags:
            self._resolve()
            self.log.info("surveyed by memory", count=len(tags), tags=tags[:NAMED])

    def _resolve(self) -> None:
        """The surveys are others: solve at once."""
        self.solving.cadence.changed()
        self.solving.cadence.want()

    def _handle(self, event: Any) -> None:
        match event:
            case Query():
                self.desk.answer(event)
            case Presence():
                self.mapper.presence(event.robot, event.alive)
                self.log.info("robot", robot=event.robot, alive=event.alive)
            case Solved():
                self._adopt(event)
            case Failed():
                self.solving.fail(event)
            case JobAnswer():
                self.memories.answer(event, self.mapper)

    def _ingest(self, arrivals: list[Arrival]) -> None:
        if not arrivals:
            return
        outcome = self.mapper.step(arrivals)
        if outcome.has_facts:
            readings = self.memories.readings(outcome.keyframes)
            self.store.commit(_batch(outcome, readings, self.clock.utc_ns()))
            self.memories.heard(outcome.keyframes, readings)
            self._recover()
        for robot, ack in outcome.acks:
            self.link.put(self.keys.ack(robot), encode(ack))
        if outcome.hellos or outcome.keyframes:
            self.solving.cadence.changed()
        for event in outcome.events:
            if self.throttle.allows(event.name):
                self.log.info(event.name, **event.fields)

    def _follow(self) -> None:
        """After the commit: no pose is ahead of the database."""
        for robot, pose in self.mapper.follow().items():
            self.link.put(self.keys.pose(robot), encode(pose))

    def _write_back(self) -> None:
        self.memories.tick(self.mapper)

    def _adopt(self, result: Solved) -> None:
        adoption = self.solving.finish(result, self.mapper, self.clock.utc_ns())
        if adoption is not None:
            self.link.put(self.keys.map_version(), encode(adoption.version))
            for tag in adoption.changed:
                self.link.put(self.keys.map_tag(tag.tag), encode(tag))
            self._log_version(adoption)
        self.solving.settle()

    def _log_version(self, adoption: Adoption) -> None:
        version, summary = adoption.version, self.solving.summary or {}
        told = ("keyframes", "converged", "inliers", "rejected", "solve_s")
        self.log.info(
            "map version",
            version=version.version,
            cause=version.cause,
            gauge=version.gauge,
            tags=version.tags,
            withheld=version.withheld,
            **{name: summary[name] for name in told},
        )

    def _let_go(self) -> None:
        """Of what is too old, a little at a time, and nothing that the solver may be reading."""
        now_s = self.clock.monotonic_s()
        if now_s < self.let_go_s or self.solving.cadence.running is not None:
            return
        went = self.store.archive(self.keep)
        self.let_go_s = now_s + (0.0 if went else LET_GO_S)

    def _break(self, error: Exception) -> None:
        """The mapper is ahead of the database, or broken: no acknowledgement, start over."""
        if not self.complained:
            known = isinstance(error, StoreError)
            event = "commit failed" if known else "unexpected failure"
            self.log.error(event, reason=str(error), exc_info=None if known else error)
        self.complained = True
        self.broken_until_s = self.clock.monotonic_s() + RETRY_S

    def _is_sound(self) -> bool:
        """Restore the mapper some time after something broke; keyframes that arrive meanwhile are
        lost, as on a bad link."""
        if self.broken_until_s is None:
            return True
        if self.clock.monotonic_s() < self.broken_until_s:
            return False
        try:
            mapper = self._restored()
        except TagmapError:
            self.broken_until_s = self.clock.monotonic_s() + RETRY_S
            return False
        mapper.alive = self.mapper.alive
        self.mapper = self.desk.mapper = mapper
        self.broken_until_s = None
        return True

    def _restored(self) -> Mapper:
        mapper = restore(self.store)
        mapper.ingest.grants = self.leasing.arbiter.grants
        return mapper

    def _recover(self) -> None:
        """After a commit that went well."""
        if self.complained:
            self.log.info("commits again")
            self.complained = False

    def _turn_away(self, event: Any) -> None:
        if isinstance(event, Query):
            self._cannot_answer(event)
        elif isinstance(event, Solved):
            self.solving.fail(Failed("the database cannot be written"))
        elif not isinstance(event, JobAnswer):
            self._handle(event)

    def _cannot_answer(self, query: Query) -> None:
        """Who asks how far it is settled would take an error for having nothing."""
        if query.key.endswith("/ack"):
            query.drop()
        else:
            query.reply_error("the service cannot write its database; see its log")

    def _keep_router(self) -> None:
        now_s = self.clock.monotonic_s()
        if self.router is None or now_s < self.router_check_s:
            return
        self.router_check_s = now_s + ROUTER_CHECK_S
        status = self.router.poll()
        if status is None:
            return
        if self.throttle.allows("router ended"):
            self.log.error("router ended", status=status)
        try:
            self.router.start()
        except (LinkError, OSError) as error:
            if self.throttle.allows("no router"):
                self.log.error("no router", reason=str(error))

    def _report_flood(self) -> None:
        for name, count in self.throttle.turn(self.clock.monotonic_s()).items():
            self.log.warning("more of the same", of=name, count=count)

    def _status(self, query: Query, _args: Args) -> None:
        head, solver = self.mapper.status(), self.solving.state()
        head["memories_refused"] = len(self.memories.surveys.refused)

        def lookup(store: SiteStore) -> Any:
            return head | asdict(store.counts()) | {"solver": solver}

        self.desk.look_up(query, lookup)

    def _solve(self, query: Query, args: Args) -> None:
        self.solving.wait(query, flag(args, "from_nothing"))

    def _survey_one(self, query: Query, args: Args) -> None:
        p_m = [args.get(name) for name in ("x_m", "y_m", "z_m")]
        self.survey([surveyed(args.get("tag"), p_m, args.get("sigma_m"))])
        self.desk.confirm(
            query, {"tag": args["tag"], "surveyed": len(self.mapper.surveys.in_force)}
        )

    def _list_memories(self, query: Query, _args: Args) -> None:
        self.desk.confirm(query, {"tags": self.memories.states(self.mapper)})


def _batch(outcome: Outcome, readings: list[Reading], now_ns: int) -> Batch:
    refusals = [RefusalRow(r.robot, r.session, r.seq, r.reason, now_ns) for r in outcome.refused]
    return Batch(
        hellos=outcome.hellos,
        keyframes=outcome.keyframes,
        refusals=refusals,
        readings=readings,
    )
