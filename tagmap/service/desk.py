"""Answers every question that arrives, with a record or with an error; none is left hanging."""

from collections.abc import Callable
from typing import Any, TypeAlias

import msgspec
import structlog

from tagmap.errors import RecordRefused, TagmapError
from tagmap.link.keys import Keys
from tagmap.link.query import Query
from tagmap.mapper import Mapper
from tagmap.mapping.past import Moment, bracket, describe_range, pose_between
from tagmap.mapping.selection import expect, parse, whole
from tagmap.records import (
    AdminReply,
    AdminRequest,
    LeaseRequest,
    LocalizeRequest,
    Tag,
    decode,
    encode,
)
from tagmap.records.base import Message
from tagmap.service.admin import HANDLERS, Args
from tagmap.service.archive import Lookup
from tagmap.service.leasing import Leasing
from tagmap.service.memories import Memories
from tagmap.service.ports import Answering
from tagmap.service.wildcards import covers, is_exact
from tagmap.store import PoseRow, SiteStore

Command: TypeAlias = Callable[[Query, Args], None]


class Desk:
    """`mapper` is the loop's, which replaces it after a failed commit. `commands` are the admin
    commands that the loop carries out itself; they end the query, at once or later.
    """

    def __init__(
        self, keys: Keys, mapper: Mapper, archive: Answering, leasing: Leasing, memories: Memories
    ) -> None:
        self.keys = keys
        self.mapper = mapper
        self.leasing = leasing
        self.memories = memories
        self.commands: dict[tuple[str, str], Command] = {}
        self._archive = archive
        self._log = structlog.get_logger("desk")

    def answer(self, query: Query) -> None:
        try:
            self._answer(query)
        except TagmapError as error:
            query.reply_error(str(error))
        except Exception:
            self._log.exception("question failed", key=query.key)
            query.reply_error("internal error; see the service's log")

    def refuse(self, query: Query, reason: str) -> None:
        """The answer to an admin command that was not carried out."""
        query.reply(query.key, encode(AdminReply(error=reason)))

    def confirm(self, query: Query, data: Any) -> None:
        query.reply(query.key, encode(AdminReply(data=data)))

    def look_up(self, query: Query, data: Any) -> None:
        """Like `confirm`; `data` may be a function that reads it from the database."""
        self._archive.ask(query, _admin_lookup(query.key, data))

    def _answer(self, query: Query) -> None:
        """By the shape of the key: the queryables let nothing else through."""
        keys = self.keys
        below = query.key.removeprefix(keys.root + "/")
        if (command := keys.command_of(query.key)) is not None:
            self._admin(query, command)
        elif below == "localize":
            request = decode(LocalizeRequest, query.payload)
            query.reply(query.key, encode(self.mapper.localize(request)))
        elif below == "activation/lease":
            wanted = decode(LeaseRequest, query.payload)
            query.reply(query.key, encode(self.leasing.answer(wanted, self.mapper.live)))
        elif below.endswith("ack"):
            self._acks(query)
        elif below.endswith("jobs"):
            self._jobs(query)
        elif below.endswith("pose"):
            self._poses(query)
        elif below == "map/version":
            self._version(query)
        elif below.startswith("map/"):
            self._tags(query)
        else:
            raise RecordRefused(f"{query.key} is too wide a question")

    def _acks(self, query: Query) -> None:
        expect(query.parameters, ("session",))
        session = query.parameters.get("session")
        answers: list[tuple[str, bytes]] = []
        for robot in self._robots(query, self.keys.ack):
            ack = self.mapper.ack(robot, session)
            if ack is not None:
                answers.append((self.keys.ack(robot), encode(ack)))
        self._reply(query, answers, "nothing was heard of this robot yet")

    def _jobs(self, query: Query) -> None:
        expect(query.parameters, ())
        jobs = {robot: self.memories.job_of(robot) for robot in self._robots(query, self.keys.jobs)}
        answers = [(self.keys.jobs(robot), encode(job)) for robot, job in jobs.items() if job]
        self._reply(query, answers, "no job for this robot")

    def _poses(self, query: Query) -> None:
        expect(query.parameters, ("t_ns",))
        robots = self._robots(query, self.keys.pose)
        if "t_ns" in query.parameters:
            t_ns = whole("t_ns", query.parameters["t_ns"])
            self._archive.ask(query, self._past(robots, t_ns, is_exact(query.key)))
            return
        poses = [(robot, self.mapper.pose(robot)) for robot in robots]
        answers = [(self.keys.pose(robot), encode(pose)) for robot, pose in poses if pose]
        self._reply(query, answers, "no pose of this robot yet")

    def _past(self, robots: list[str], t_ns: int, exact: bool) -> Lookup:
        """Solved poses first; those followed since the last solve are not in the database yet."""
        recent = {robot: self.mapper.moments(robot) for robot in robots}
        number, gauge = self.mapper.book.number, self.mapper.book.gauge

        def lookup(store: SiteStore) -> list[tuple[str, bytes]]:
            answers = []
            for robot in robots:
                stored = store.pose_bracket(robot, t_ns)
                around = (
                    (_moment(stored[0]), _moment(stored[1]))
                    if stored is not None
                    else bracket(recent[robot], t_ns)
                )
                if around is not None:
                    pose = pose_between(*around, t_ns, number, gauge)
                    answers.append((self.keys.pose(robot), encode(pose)))
                elif exact:
                    spans = describe_range(_spans(store, robot, recent[robot]))
                    raise RecordRefused(
                        f"no pose of {robot} at t_ns {t_ns}, which is not extrapolated; "
                        f"there are poses in: {spans}"
                    )
            return answers

        return lookup

    def _version(self, query: Query) -> None:
        expect(query.parameters, ())
        version = self.mapper.book.version
        self._reply(query, [(query.key, encode(version))] if version else [], "no map yet")

    def _tags(self, query: Query) -> None:
        selection = parse(query.parameters)
        if selection.version is None or selection.version == self.mapper.book.number:
            tags = selection.of(self.mapper.book.tags.values())
            self._archive.ask(query, lambda _: self._tag_answers(query.key, tags))
            return

        def lookup(store: SiteStore) -> list[tuple[str, bytes]]:
            tags = store.tags(selection.version)
            if not tags and all(v.version != selection.version for v in store.versions()):
                raise RecordRefused(f"there is no map version {selection.version}")
            if not tags:
                raise RecordRefused(f"the tags of map version {selection.version} are not kept")
            return self._tag_answers(query.key, selection.of(tags))

        self._archive.ask(query, lookup)

    def _tag_answers(self, key: str, tags: list[Tag]) -> list[tuple[str, bytes]]:
        """One list on exactly `map/tags`, else one record per tag, on the tag's own key."""
        if key == self.keys.map_tags():
            return [(key, msgspec.msgpack.encode(tags))]
        pairs = [(self.keys.map_tag(tag.tag), tag) for tag in tags]
        answers = [(own, encode(tag)) for own, tag in pairs if covers(key, own)]
        if not answers and is_exact(key):
            raise RecordRefused(f"no such tag in the map: {self.keys.tag_of(key)}")
        return answers

    def _admin(self, query: Query, command: tuple[str, str]) -> None:
        try:
            args = decode(AdminRequest, query.payload).args if query.payload else {}
            if command in self.commands:
                self.commands[command](query, args)
                return
            handler = HANDLERS.get(command)
            if handler is None:
                raise RecordRefused(f"unknown command {' '.join(command)}")
            data = handler(self.mapper, args)
        except TagmapError as error:
            self.refuse(query, str(error))
            return
        self.look_up(query, data)

    def _robots(self, query: Query, key_of: Callable[[str], str]) -> list[str]:
        """The robots whose key the question covers, whether known or not if it names one."""
        if is_exact(query.key):
            robot = self.keys.robot_of(query.key)
            if robot is None:
                raise RecordRefused(f"{query.key} names no robot")
            return [robot]
        return [robot for robot in self.mapper.ingest.robots if covers(query.key, key_of(robot))]

    def _reply(self, query: Query, answers: list[tuple[str, bytes]], nothing: str) -> None:
        if answers or not is_exact(query.key):
            query.reply_many(answers)
        else:
            query.reply_error(nothing)


def _admin_lookup(key: str, data: Any) -> Lookup:
    def lookup(store: SiteStore) -> list[tuple[str, bytes]]:
        try:
            reply: Message = AdminReply(data=data(store) if callable(data) else data)
        except TagmapError as error:
            reply = AdminReply(error=str(error))
        return [(key, encode(reply))]

    return lookup


def _moment(row: PoseRow) -> Moment:
    return Moment(row.session, row.t_ns, row.T, row.cov)


def _spans(store: SiteStore, robot: str, recent: list[Moment]) -> list[tuple[int, int]]:
    """First and last t_ns of every session for which there are poses."""
    spans: dict[str, tuple[int, int]] = {}
    for poses in store.poses():
        if poses.robot == robot and len(poses.t_ns):
            spans[poses.session] = (int(poses.t_ns.min()), int(poses.t_ns.max()))
    for moment in recent:
        first, last = spans.get(moment.session, (moment.t_ns, moment.t_ns))
        spans[moment.session] = (min(first, moment.t_ns), max(last, moment.t_ns))
    return list(spans.values())
