"""The agent's side of the link: opened without holding up the robot, what arrives is queued."""

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

from robot_agent.flight import Parcel
from tagmap.errors import LinkError, RecordRefused
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import Ack, decode, encode

ANSWER_S = 1.0
CLOSE_S = 3.0


@dataclass(frozen=True, slots=True)
class Route:
    """How to reach a router: endpoints, or a Zenoh configuration, or one with other endpoints."""

    endpoints: Sequence[str]
    zenoh_config: Path | None


class Uplink:
    """Sends parcels, asks for acknowledgements, collects them.

    A thread of its own opens the link, however long that takes, and puts the questions, which
    block until they are answered. `trouble` is why there is no link yet.
    """

    def __init__(self, route: Route, keys: Keys, robot: str) -> None:
        self._route = route
        self._keys = keys
        self._robot = robot
        self._link: Link | None = None
        self._listening = False
        self._failure: LinkError | None = None
        self._closing = threading.Event()
        self._arrived: SimpleQueue[bytes | None] = SimpleQueue()
        self._questions: SimpleQueue[str | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._serve, name="uplink", daemon=True)
        self.trouble: str | None = None
        self.malformed = 0

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

    def wake(self) -> None:
        """End a waiting `take`; safe in a signal handler."""
        self._arrived.put(None)

    def close(self) -> None:
        self._closing.set()
        self._questions.put(None)
        self._thread.join(CLOSE_S)
        if self._link is not None:
            self._link.close()

    def _serve(self) -> None:
        try:
            self._link = link = self._open()
            link.subscribe(
                self._keys.ack(self._robot), lambda _, payload: self._arrived.put(payload)
            )
            link.declare_alive(self._keys.alive(self._robot))
            self._listening = True
            self.wake()
            while (session := self._questions.get()) is not None and not self._closing.is_set():
                self._put_question(link, session)
        except Exception as error:
            # Whatever it is, an agent that can no longer hear must not go on as if it could.
            self._failure = error if isinstance(error, LinkError) else LinkError(f"link: {error}")
            self.wake()

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
            self.malformed += 1
            return None
