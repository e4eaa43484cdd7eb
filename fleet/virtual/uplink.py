"""The agent's side of the bus, with the methods of robot_agent.uplink.Uplink."""

from collections.abc import Iterable

from fleet.virtual.port import Port
from robot_agent.atlas.served import ServedMap, tags_of
from robot_agent.errands import ANSWER_S, MAP_AGAIN_S
from robot_agent.flight import Parcel
from tagmap.errors import RecordRefused
from tagmap.link.keys import Keys
from tagmap.link.query import Reply
from tagmap.records import (
    Ack,
    JobResult,
    LeaseReply,
    LeaseRequest,
    MapVersion,
    Pose,
    WriteJob,
    decode,
    encode,
)

SECOND_NS = 1_000_000_000


class VirtualUplink:
    """Questions are under way while their asker goes on, as with a thread of their own; only
    `take` and `lease` wait. `senses`: also jobs and the map."""

    def __init__(self, port: Port, keys: Keys, robot: str, senses: bool = False) -> None:
        self._port, self._keys, self._robot, self._senses = port, keys, robot, senses
        self._started = self._woken = False
        self._arrived: list[bytes] = []
        self._jobs: list[WriteJob] = []
        self._served: ServedMap | None = None
        self._fetches = 0
        self.trouble: str | None = None
        self.malformed = 0

    def start(self) -> None:
        port, keys = self._port, self._keys
        port.subscribe(keys.ack(self._robot), lambda _, payload: self._arrived.append(payload))
        if self._senses:
            port.subscribe(keys.jobs(self._robot), lambda _, payload: self._take_job(payload))
            port.subscribe(keys.map_version(), lambda *_: self._fetch())
            self._fetch()
        port.declare_alive(keys.alive(self._robot))
        self._started = True

    def connected(self) -> bool:
        return self._started and self._port.connected()

    def send(self, parcels: Iterable[Parcel]) -> None:
        for parcel in parcels:
            self._port.put(self._keys.keyframes(self._robot), parcel.payload)

    def ask(self, sessions: Iterable[str]) -> None:
        for session in sessions:
            selector = f"{self._keys.ack(self._robot)}?session={session}"

            def heard(replies: list[Reply], session: str = session) -> None:
                self._hear(replies, session)

            self._port.inquire(selector, None, ANSWER_S, heard)

    def take(self, wait_s: float) -> list[Ack]:
        until_ns = self._port.now_ns() + round(wait_s * SECOND_NS)
        self._port.wait(lambda: bool(self._arrived or self._woken), until_ns)
        payloads, self._arrived, self._woken = self._arrived, [], False
        return [ack for payload in payloads if (ack := self._decoded(payload))]

    def lease(self, request: LeaseRequest, timeout_s: float) -> LeaseReply | None:
        """None: no answer in time, or a refusal."""
        replies = self._port.get(self._keys.lease(), encode(request), timeout_s=timeout_s)
        answer = _payload_of(replies)
        try:
            return None if answer is None else decode(LeaseReply, answer)
        except RecordRefused:
            return None

    def publish_pose(self, pose: Pose) -> None:
        self._port.put(self._keys.agent_pose(self._robot), encode(pose))

    def publish_result(self, result: JobResult) -> None:
        self._port.put(self._keys.job_results(self._robot), encode(result))

    def jobs(self) -> list[WriteJob]:
        """Those that came since they were last asked for."""
        jobs, self._jobs = self._jobs, []
        return jobs

    def served(self) -> ServedMap | None:
        """The newest map that came since it was last asked for."""
        served, self._served = self._served, None
        return served

    def wake(self) -> None:
        self._woken = True
        self._port.at(self._port.now_ns(), lambda: None)

    def close(self) -> None:
        self._port.close()

    def _hear(self, replies: list[Reply], session: str) -> None:
        """As robot_agent.uplink has it: an error is an answer, no answer is no news."""
        for reply in replies:
            if reply.payload is not None:
                self._arrived.append(reply.payload)
            elif reply.error != "Timeout":
                self._arrived.append(encode(Ack(session=session, contiguous=-1)))

    def _decoded(self, payload: bytes) -> Ack | None:
        try:
            return decode(Ack, payload)
        except RecordRefused:
            self.malformed += 1
            return None

    def _take_job(self, payload: bytes | None) -> None:
        if payload is None:
            return
        try:
            self._jobs.append(decode(WriteJob, payload))
        except RecordRefused:
            self.malformed += 1

    def _fetch(self) -> None:
        """At first, whenever a map is announced, and now and then for what was lost on its way."""
        self._fetches += 1
        number = self._fetches
        again_ns = self._port.now_ns() + round(MAP_AGAIN_S * SECOND_NS)
        self._port.at(again_ns, lambda: self._fetch() if self._fetches == number else None)
        jobs, version = self._keys.jobs(self._robot), self._keys.map_version()
        self._port.inquire(
            jobs, None, ANSWER_S, lambda replies: self._take_job(_payload_of(replies))
        )
        self._port.inquire(version, None, ANSWER_S, self._fetch_tags)

    def _fetch_tags(self, replies: list[Reply]) -> None:
        version = _payload_of(replies)
        if version is not None:
            tags = self._keys.map_tags()
            self._port.inquire(tags, None, ANSWER_S, lambda found: self._serve(version, found))

    def _serve(self, version: bytes, replies: list[Reply]) -> None:
        """Another version may have come in between: it is announced."""
        tags = _payload_of(replies)
        if tags is None:
            return
        try:
            about, all_tags = decode(MapVersion, version), tags_of(tags)
        except RecordRefused:
            return
        if all(tag.version == about.version for tag in all_tags):
            self._served = ServedMap(site=self._keys.site, version=about, tags=all_tags)
        else:
            self._fetch()


def _payload_of(replies: list[Reply]) -> bytes | None:
    return next((reply.payload for reply in replies if reply.payload is not None), None)
