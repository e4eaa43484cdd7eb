"""What the memories of tags were read to hold: what people surveyed, and the jobs that put right
what they should say (write-back).

Only what is committed is believed, so after a restart the planner knows what it knew.
"""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import structlog

from tagmap.clock import Clock
from tagmap.errors import RecordRefused
from tagmap.link.keys import Keys
from tagmap.mapper import Mapper
from tagmap.mapping.surveying import Surveys
from tagmap.memory.surveys import ReadSurveys
from tagmap.records import JobResult, Keyframe, WriteJob, decode, encode
from tagmap.service.ports import Sending
from tagmap.store import Batch, MemorySurvey, Reading, SiteStore
from tagmap.writeback.map_wishes import wishes
from tagmap.writeback.planner import Planner, Seer
from tagmap.writeback.wanted import Owner

TICK_S = 1.0
FRESH_S = 5.0


@dataclass(frozen=True, slots=True)
class JobAnswer:
    """A message on `agents/<robot>/jobs/results`; `robot` is the key's."""

    robot: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class _Glimpse:
    """What a robot's newest keyframe saw, and when it came."""

    heard_s: float
    tags: tuple[str, ...]


class Memories:
    def __init__(
        self, store: SiteStore, link: Sending, keys: Keys, owner: Owner, clock: Clock
    ) -> None:
        self._store, self._link, self._keys = store, link, keys
        self._clock = clock
        self._log = structlog.get_logger("memories")
        self._planner = Planner(owner)
        self._glimpses: dict[str, _Glimpse] = {}
        self._version: int | None = None
        self._tick_s = 0.0
        for row in store.memories():
            self._planner.restore(row.tag, row.memory, row.writes)
        self.surveys = ReadSurveys(owner.site, owner.key)
        for tag, memory, robot in store.readings():
            self.surveys.hear(tag, memory, robot)

    def readings(self, keyframes: Iterable[Keyframe]) -> list[Reading]:
        """What these keyframes say that is not known already, to be committed with them."""
        news: dict[tuple[str, bytes], Reading] = {}
        for keyframe in keyframes:
            for sighting in keyframe.sightings:
                tag, memory = sighting.tag, sighting.memory
                if memory is not None and memory != self._planner.held(tag):
                    reading = Reading(tag, keyframe.robot, memory, self._clock.utc_ns())
                    # What was read last comes last.
                    news.pop((tag, memory), None)
                    news[tag, memory] = reading
        return list(news.values())

    def heard(self, keyframes: Iterable[Keyframe], readings: Iterable[Reading]) -> None:
        """After the commit."""
        now_s = self._clock.monotonic_s()
        for keyframe in keyframes:
            tags = tuple(sighting.tag for sighting in keyframe.sightings)
            self._glimpses[keyframe.robot] = _Glimpse(now_s, tags)
        for reading in readings:
            if reading.memory is not None:
                self._planner.heard(reading.tag, reading.memory)
                self.surveys.hear(reading.tag, reading.memory, reading.robot)

    def answer(self, event: JobAnswer, mapper: Mapper) -> None:
        """Commit what a robot says of its job, then believe it."""
        try:
            result = _result(event, mapper)
        except RecordRefused as error:
            self._log.info("job result refused", robot=event.robot, reason=error.reason)
            return
        told = (result.job, result.outcome, result.reason)
        reading = Reading(result.tag, event.robot, result.read, self._clock.utc_ns(), *told)
        self._store.commit(Batch(readings=[reading]))
        self._planner.answer(event.robot, result, self._clock.monotonic_ns())
        if result.read is not None:
            self.surveys.hear(result.tag, result.read, event.robot)
        place = {"tag": result.tag, "robot": event.robot, "job": result.job}
        self._log.info("job answered", outcome=result.outcome, reason=result.reason, **place)

    def tick(self, mapper: Mapper) -> None:
        """Once a second: follow the map, and give out jobs."""
        if self._clock.monotonic_s() < self._tick_s:
            return
        self._tick_s = self._clock.monotonic_s() + TICK_S
        self._follow(mapper)
        now_ns, utc_ns = self._clock.monotonic_ns(), self._clock.utc_ns()
        for order in self._planner.plan(self._seen(mapper), now_ns, utc_ns):
            self._link.put(self._keys.jobs(order.robot), encode(order.job))
            job = order.job
            self._log.info("write-back", tag=job.tag, robot=order.robot, job=job.job)

    def job_of(self, robot: str) -> WriteJob | None:
        return self._planner.job_of(robot, self._clock.monotonic_ns())

    def states(self, mapper: Mapper) -> list[dict[str, Any]]:
        """For `tagmap tags list --memory`."""
        self._follow(mapper)
        states = self._planner.states(self._clock.monotonic_ns())
        return [asdict(state) | {"survey": self._verdict(state.tag, mapper)} for state in states]

    def news(self, surveys: Surveys) -> list[MemorySurvey]:
        """In what these differ from what the memories say people surveyed, to be committed."""
        t_ns, found = self._clock.utc_ns(), self.surveys.found
        over = [tag for tag in surveys.remembered if tag not in found]
        told = [MemorySurvey(tag, None, None, None, t_ns) for tag in over]
        for tag, one in found.items():
            before = surveys.remembered.get(tag)
            if before is None or (before.p_m, before.cov) != (one.p_m, one.cov):
                told.append(MemorySurvey(tag, one.p_m, one.cov, one.robot, t_ns))
        return told

    def _verdict(self, tag: str, mapper: Mapper) -> str | None:
        """What became of the survey that a memory tells."""
        refused = self.surveys.refused.get(tag)
        if refused is not None:
            return f"refused: {refused}"
        if tag not in self.surveys.found:
            return None
        return "an operator's counts" if tag in mapper.surveys.told else "counts"

    def _follow(self, mapper: Mapper) -> None:
        version = mapper.book.version
        if version is None or version.version == self._version:
            return
        in_force = mapper.surveys.in_force
        surveys = {tag: (survey.p_m, survey.covariance) for tag, survey in in_force.items()}
        self._planner.wanted = wishes(version, mapper.book.tags.values(), surveys)
        self._version = version.version

    def _seen(self, mapper: Mapper) -> dict[str, list[Seer]]:
        """Who sees which tag now, of those that are there and know where they are."""
        seen: dict[str, list[Seer]] = {}
        for robot, glimpse in self._glimpses.items():
            live, number = mapper.live.robots.get(robot), mapper.ingest.robots[robot].number
            T_map_base = live.pose.T_map_base if live is not None and live.pose else None
            if self._clock.monotonic_s() - glimpse.heard_s > FRESH_S or robot not in mapper.alive:
                continue
            if live is None or number is None or T_map_base is None:
                continue
            for name in glimpse.tags:
                tag = mapper.book.tags.get(name)
                if tag is not None and tag.p_m is not None:
                    distance_m = math.dist(T_map_base.p_m, tag.p_m)
                    write_range_m = live.hello.limits.write_range_m
                    seer = Seer(robot, number, distance_m, write_range_m)
                    seen.setdefault(name, []).append(seer)
        return seen


def _result(event: JobAnswer, mapper: Mapper) -> JobResult:
    result = decode(JobResult, event.payload)
    if result.robot != event.robot:
        raise RecordRefused(f"names robot {result.robot}, the key names {event.robot}")
    if event.robot not in mapper.live.robots:
        raise RecordRefused("has not said hello")
    return result
