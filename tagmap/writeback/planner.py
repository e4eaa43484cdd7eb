"""One job for one tag to one robot at a time, until the tag's memory says what the map says.

All that has to be remembered is what each memory held when it was last read: it is in the
keyframes and in the answers to jobs. Jobs themselves need not survive. A job that is given out
again, late, twice or to another robot does no harm, because every robot reads before it writes and
writes nothing that is there already. So what is believed may be old; it is put right by one job.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from msgspec.structs import replace

from tagmap.errors import RecordRefused
from tagmap.memory.slots import encode_for, read
from tagmap.records import JobResult, WriteJob
from tagmap.writeback.wanted import Owner, Wanted, judge

State: TypeAlias = Literal["unread", "verified", "pending", "waiting", "kept"]

SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Rules:
    """range_m  a robot further away from the tag cannot light it
    valid_s     of a job; `grace_s` after that its answer is no longer waited for
    unseen_s    a robot that has not seen the tag of its job for so long has driven on
    pause_s     before a tag is tried again after a failure; doubles each time up to `most_s`
    """

    range_m: float = 30.0
    valid_s: float = 60.0
    unseen_s: float = 5.0
    grace_s: float = 5.0
    pause_s: float = 10.0
    most_s: float = 3600.0


@dataclass(frozen=True, slots=True)
class Seer:
    """A robot that sees the tag now. `write_range_m` None: nobody knows how far it can write."""

    robot: str
    number: int
    distance_m: float
    write_range_m: float | None = None


@dataclass(frozen=True, slots=True)
class Order:
    robot: str
    job: WriteJob


@dataclass(slots=True)
class _Open:
    """`seen_ns`: when the robot saw the tag last."""

    order: Order
    until_ns: int
    seen_ns: int


@dataclass(slots=True)
class _Memory:
    """What is known of one tag's memory.

    held       its bytes as they were last read
    writes     how often it was written, as far as robots said; `written_for`: the last job
    failed     failures since it was last fine, by robot
    pause_ns   no new job before
    trouble    what went wrong last
    """

    held: bytes | None = None
    writes: int = 0
    written_for: int | None = None
    failed: dict[str, int] = field(default_factory=dict)
    pause_ns: int = 0
    trouble: str | None = None


@dataclass(frozen=True, slots=True)
class MemoryState:
    """What `tags list --memory` shows of one tag.

    unread    nobody has read its memory
    verified  as it was last read, it says what the map says
    pending   a job is out, to `robot`
    waiting   for a robot that sees it, or for the pause after a failure
    kept      it says something else and stays so, see `reason`
    """

    tag: str
    state: State
    reason: str | None = None
    robot: str | None = None
    writes: int = 0


class Planner:
    """`now_ns` is any clock that does not jump; `number` of new jobs must exceed all former ones,
    over restarts too: the time of day in ns does.
    """

    def __init__(self, owner: Owner, rules: Rules | None = None) -> None:
        self.owner = owner
        self.rules = rules or Rules()
        self.wanted: Mapping[str, Wanted] = {}
        self._memories: dict[str, _Memory] = {}
        self._open: dict[str, _Open] = {}
        self._last_job = 0

    def heard(self, tag: str, memory: bytes, job: int | None = None) -> None:
        """A robot has read the memory; `job`: after writing it for this one."""
        known = self._of(tag)
        known.held = memory
        if job is not None and job != known.written_for:
            known.written_for = job
            known.writes += 1

    def restore(self, tag: str, memory: bytes, writes: int) -> None:
        """What was stored before a restart."""
        known = self._of(tag)
        known.held, known.writes = memory, writes

    def held(self, tag: str) -> bytes | None:
        """The memory as it was last read."""
        known = self._memories.get(tag)
        return None if known is None else known.held

    def plan(self, seen: Mapping[str, Sequence[Seer]], now_ns: int, number: int) -> list[Order]:
        """New jobs for what is `seen`, by tag. A robot has one job at a time."""
        self._expire(now_ns)
        self._let_go(seen, now_ns)
        busy = {out.order.robot for out in self._open.values()}
        orders: list[Order] = []
        for tag, seers in seen.items():
            order = self._order(tag, seers, busy, now_ns, number)
            if order is not None:
                orders.append(order)
                busy.add(order.robot)
        return orders

    def answer(self, robot: str, result: JobResult, now_ns: int) -> None:
        """Whatever job it answers, what was read counts; a job that is out for this is over."""
        tag = result.tag
        if result.read is not None:
            self.heard(tag, result.read, result.job if result.outcome == "written" else None)
        out = self._open.get(tag)
        if out is None or (out.order.job.job, out.order.robot) != (result.job, robot):
            return
        del self._open[tag]
        if self._is_done(tag, out.order.job.record):
            known = self._memories[tag]
            known.failed.clear()
            known.trouble = None
        else:
            self._fail(tag, robot, result.reason or f"{robot}: {result.outcome}", now_ns)

    def states(self, now_ns: int) -> list[MemoryState]:
        """Of all tags that are wanted or were read, by name."""
        self._expire(now_ns)
        return [self._state(tag) for tag in sorted(self.wanted.keys() | self._memories.keys())]

    def job_of(self, robot: str, now_ns: int) -> WriteJob | None:
        """The job that is out to this robot, for as long as is left."""
        for out in self._open.values():
            left_s = (out.until_ns - now_ns) / SECOND_NS - self.rules.grace_s
            if out.order.robot == robot and left_s > 0.0:
                return replace(out.order.job, valid_s=left_s)
        return None

    def _order(
        self, tag: str, seers: Iterable[Seer], busy: set[str], now_ns: int, number: int
    ) -> Order | None:
        known, wanted = self._memories.get(tag), self.wanted.get(tag)
        if wanted is None or known is None or known.held is None:
            return None
        if tag in self._open or now_ns < known.pause_ns:
            return None
        able = [seer for seer in seers if seer.robot not in busy and self._is_able(seer)]
        if not able or judge(wanted, known.held, tag, self.owner, known.writes).need != "write":
            return None
        seer = min(able, key=lambda one: (known.failed.get(one.robot, 0), one.distance_m))
        self._last_job = job = max(number, self._last_job + 1)
        record = wanted.record(self.owner, seer.number)
        data = encode_for(len(known.held), record, tag, self.owner.key)
        valid_s = self.rules.valid_s
        order = Order(seer.robot, WriteJob(job=job, tag=tag, record=data, valid_s=valid_s))
        until_ns = now_ns + round((valid_s + self.rules.grace_s) * SECOND_NS)
        self._open[tag] = _Open(order, until_ns, now_ns)
        return order

    def _is_able(self, seer: Seer) -> bool:
        reach_m = self.rules.range_m if seer.write_range_m is None else seer.write_range_m
        return seer.distance_m <= min(self.rules.range_m, reach_m)

    def _is_done(self, tag: str, data: bytes) -> bool:
        """The memory says what the job said, or what the map says now."""
        known, wanted = self._of(tag), self.wanted.get(tag)
        if known.held is None:
            return False
        if wanted and judge(wanted, known.held, tag, self.owner, known.writes).need == "fine":
            return True
        try:
            contents = read(known.held, tag, self.owner.key, self.owner.site)
        except RecordRefused:
            return False
        newest = contents.newest
        return newest is not None and known.held[contents.layout.slice(newest)] == data

    def _expire(self, now_ns: int) -> None:
        over = [tag for tag, out in self._open.items() if now_ns >= out.until_ns]
        for tag in over:
            robot = self._open.pop(tag).order.robot
            self._fail(tag, robot, f"no answer from {robot}", now_ns)

    def _let_go(self, seen: Mapping[str, Sequence[Seer]], now_ns: int) -> None:
        """Of jobs whose robot has driven on: nobody failed, and both may have other work. Should it
        do its job all the same, what it reads back counts."""
        for tag, out in list(self._open.items()):
            if any(seer.robot == out.order.robot for seer in seen.get(tag, ())):
                out.seen_ns = now_ns
            elif now_ns - out.seen_ns > self.rules.unseen_s * SECOND_NS:
                del self._open[tag]

    def _fail(self, tag: str, robot: str, reason: str, now_ns: int) -> None:
        known = self._memories[tag]
        known.failed[robot] = known.failed.get(robot, 0) + 1
        known.trouble = reason
        doublings = min(sum(known.failed.values()) - 1, 32)
        pause_s = min(self.rules.most_s, self.rules.pause_s * 2.0**doublings)
        known.pause_ns = now_ns + round(pause_s * SECOND_NS)

    def _state(self, tag: str) -> MemoryState:
        known = self._memories.get(tag) or _Memory()
        wanted, out = self.wanted.get(tag), self._open.get(tag)
        if known.held is None:
            return MemoryState(tag, "unread")
        if out is not None:
            return MemoryState(tag, "pending", known.trouble, out.order.robot, known.writes)
        if wanted is None:
            return MemoryState(tag, "waiting", "not on an anchored map", None, known.writes)
        verdict = judge(wanted, known.held, tag, self.owner, known.writes)
        if verdict.need == "fine":
            return MemoryState(tag, "verified", None, None, known.writes)
        if verdict.need == "kept":
            return MemoryState(tag, "kept", verdict.reason, None, known.writes)
        return MemoryState(tag, "waiting", known.trouble or verdict.reason, None, known.writes)

    def _of(self, tag: str) -> _Memory:
        return self._memories.setdefault(tag, _Memory())
