"""The agent's side of the link: opened without holding up the robot, what arrives is queued."""

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

from robot_agent.atlas.served import ServedMap
from robot_agent.errands import ANSWER_S, Errands
from robot_agent.flight import Parcel
from tagmap.errors import LinkError, RecordRefused
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import (
    Ack,
    JobResult,
    LeaseReply,
    LeaseRequest,
    Pose,
    WriteJob,
    decode,
    encode,
)

CLOSE_S = 3.0


@dataclass(frozen=True, slots=True)
class Route:
    """How to reach a router: endpoints, or a Zenoh configuration, or one with other endpoints."""

    endpoints: Sequence[str]
    zenoh_config: Path | None


class Uplink:
    """Sends parcels, asks for acknowledgements, collects them; `senses`: also what a robot with
    cameras and laser wants of the service: leases, jobs, and the map.

    A thread of its own opens the link, however long that takes, and puts the questions, which
    block until they are answered. `trouble` is why there is no link yet.
    """

    def __init__(self, route: Route, keys: Keys, robot: str, senses: bool = False) -> None:
        self._senses = senses
        self._route = route
        self._keys = keys
        self._robot = robot
        self._link: Link | None = None
        self._listening = False
        self._failure: LinkError | None = None
        self._closing = threading.Event()
        self._arrived: SimpleQueue[bytes | None] = SimpleQueue()
        self._questions: SimpleQueue[str | None] = SimpleQueue()
        self._errands = Errands(keys, robot)
        self._thread = threading.Thread(target=self._serve, name="uplink", daemon=True)
        self.trouble: str | None = None
        self._malformed = 0

    @property
    def malformed(self) -> int:
        """Messages that were none."""
        return self._malformed + self._errands.malformed

    @property
    def map_trouble(self) -> str | None:
        """Why the map that was fetched last is none."""
        return self._errands.trouble

    def start(self) -> None:
        self._thread.start()

    def connected(self) -> bool:
        """Raises LinkError when there can never be a link, for example for a bad certificate."""
        if self._failure is not None:
            raise self._failure
        return self._listening and self._link is not None and self._link.connected()

    def send(self, parcels: Iterable[Parcel]) -> None:
        """Nothing is promised: what is not acknowledged was not sent."""
        if self._link is not None:
            key = self._keys.keyframes(self._robot)
            for parcel in parcels:
                self._link.put(key, parcel.payload)

    def ask(self, sessions: Iterable[str]) -> None:
        for session in sessions:
            self._questions.put(session)

    def take(self, wait_s: float) -> list[Ack]:
        """What arrived; waits up to `wait_s` for the first."""
        payloads: list[bytes | None] = []
        try:
            payloads.append(self._arrived.get(block=wait_s > 0.0, timeout=wait_s))
            while True:
                payloads.append(self._arrived.get_nowait())
        except Empty:
            pass
        return [ack for payload in payloads if payload and (ack := self._decoded(payload))]

    def lease(self, request: LeaseRequest, timeout_s: float) -> LeaseReply | None:
        """None: no answer in time, or a refusal."""
        if self._link is None:
            return None
        try:
            replies = self._link.get(self._keys.lease(), encode(request), timeout_s=timeout_s)
            answers = [reply.payload for reply in replies if reply.payload is not None]
            return decode(LeaseReply, answers[0]) if answers else None
        except (LinkError, RecordRefused):
            return None

    def publish_pose(self, pose: Pose) -> None:
        self._put(self._keys.agent_pose(self._robot), encode(pose))

    def publish_result(self, result: JobResult) -> None:
        self._put(self._keys.job_results(self._robot), encode(result))

    def jobs(self) -> list[WriteJob]:
        """Those that came since they were last asked for."""
        return self._errands.jobs()

    def served(self) -> ServedMap | None:
        """The newest map that came since it was last asked for."""
        return self._errands.served()

    def wake(self) -> None:
        """End a waiting `take`; safe in a signal handler."""
        self._arrived.put(None)

    def close(self) -> None:
        self._closing.set()
        self._questions.put(None)
        if self._thread.is_alive():
            self._thread.join(CLOSE_S)
        self._errands.end(CLOSE_S)
        if self._link is not None:
            self._link.close()

    def _serve(self) -> None:
        try:
            self._link = link = self._open()
            link.subscribe(
                self._keys.ack(self._robot), lambda _, payload: self._arrived.put(payload)
            )
            if self._senses:
                self._errands.begin(link)
            link.declare_alive(self._keys.alive(self._robot))
            self._listening = True
            self.wake()
            while (session := self._questions.get()) is not None and not self._closing.is_set():
                self._put_question(link, session)
        except Exception as error:
            # Whatever it is, an agent that can no longer hear must not go on as if it could.
            self._failure = error if isinstance(error, LinkError) else LinkError(f"link: {error}")
            self.wake()

    def _put(self, key: str, payload: bytes) -> None:
        if self._link is not None:
            self._link.put(key, payload)

    def _open(self) -> Link:
        return Link.open(
            self._route.endpoints,
            zenoh_config=self._route.zenoh_config,
            wait_s=None,
            stopped=self._closing.is_set,
            on_waiting=self._note_trouble,
        )

    def _note_trouble(self, reason: str) -> None:
        self.trouble = reason
        self.wake()

    def _put_question(self, link: Link, session: str) -> None:
        """No answer is no news, the agent asks again. An error is an answer: somebody is there,
        who has not heard of the session, or knows no more than that of it."""
        selector = f"{self._keys.ack(self._robot)}?session={session}"
        for reply in link.get(selector, timeout_s=ANSWER_S):
            if reply.payload is not None:
                self._arrived.put(reply.payload)
            elif reply.error != "Timeout":
                self._arrived.put(encode(Ack(session=session, contiguous=-1)))

    def _decoded(self, payload: bytes) -> Ack | None:
        try:
            return decode(Ack, payload)
        except RecordRefused:
            self._malformed += 1
            return None
