"""The agent as a process: source, outbox, link and clock around `Courier.step`."""

import threading
from collections.abc import Callable, Sequence
from typing import TypeVar

from robot_agent.carrier import Carrier
from robot_agent.courier import Courier, Inputs, Outputs, Room
from robot_agent.diary import Diary
from robot_agent.flight import Parcel
from robot_agent.sources import Source
from tagmap.clock import Clock
from tagmap.errors import DataError, StoreUnavailable
from tagmap.records import Ack, Observation
from tagmap.store.outbox import Outbox

CHUNK = 256
BACKLOG = 1024
TURN_S = 0.02
LAST_WORD_S = 2.0
AGAIN_S = 1.0
"""After a write that failed for want of a disk."""

T = TypeVar("T")


class Shell:
    """One loop owns everything; it ends when the source is exhausted and all is settled.

    A source that can wait is read at most `BACKLOG` observations ahead of the acknowledgements;
    one that cannot is always read, router or not, and the outbox grows. When the disk is full,
    delivery waits: whoever senses goes on without it.
    """

    def __init__(
        self,
        courier: Courier,
        source: Source,
        outbox: Outbox,
        uplink: Carrier,
        diary: Diary,
        clock: Clock | None = None,
    ):
        self._courier = courier
        self._source = source
        self._outbox = outbox
        self._uplink = uplink
        self._diary = diary
        self._clock = clock or Clock()
        self._stop = threading.Event()
        self.damage: DataError | None = None
        self._room = Room(0, 0)
        self._loaded: tuple[str, int] | None = None
        self._heard: list[Ack] = []

    def stop(self) -> None:
        """End after the turn that is under way; safe in a signal handler."""
        self._stop.set()
        self._uplink.wake()

    def run(self) -> None:
        """With a damaged source, until everything before the damage is settled; see `damage`."""
        self._start()
        busy = True
        while not self._stop.is_set() and not self._is_done():
            busy = self._turn(0.0 if busy else self._source.pause_s)
        if not self._stop.is_set():
            self._hear_last_words()

    def _start(self) -> None:
        hello = self._courier.hello()
        self._durably(lambda: self._outbox.start_session(hello.session, hello.payload))
        self._position = self._outbox.resume(self._source.fingerprint)
        self._source.seek(self._position)
        self._pending = self._outbox.counts().pending
        self._diary.begins(
            session=hello.session, position=self._position, leftovers=self._pending - 1
        )
        if self._position and self._source.exhausted:
            self._diary.nothing_new(self._position)

    def _is_done(self) -> bool:
        return self._source.exhausted and not self._pending

    def _turn(self, wait_s: float) -> bool:
        """Whether anything happened, so that the next turn should follow at once."""
        acks = [*self._heard, *self._uplink.take(wait_s)]
        self._heard.clear()
        connected = self._uplink.connected()
        observations = self._observe()
        outputs = self._courier.step(
            Inputs(observations, self._load(), acks, connected), self._clock.monotonic_ns()
        )
        self._keep(outputs, len(observations))
        self._uplink.send(outputs.send)
        self._uplink.ask(outputs.ask)
        self._room = outputs.room
        self._tell(outputs, connected)
        return bool(acks or observations or outputs.send)

    def _observe(self) -> Sequence[Observation]:
        if self._source.patient and self._pending >= BACKLOG:
            return ()
        try:
            return self._source.take(CHUNK, self._clock.monotonic_ns())
        except DataError as error:
            self._diary.source_damaged(error)
            self.damage = error
            return ()

    def _load(self) -> Sequence[Parcel]:
        if not self._room.parcels:
            return ()
        rows = self._outbox.unsettled(self._room.parcels, after=self._loaded)
        parcels = self._room.fitting([Parcel(*row) for row in rows])
        if parcels:
            self._loaded = (parcels[-1].session, parcels[-1].seq)
        return parcels

    def _keep(self, outputs: Outputs, observed: int) -> None:
        if outputs.append:
            self._position += observed
            items = [(parcel.seq, parcel.payload) for parcel in outputs.append]
            session, position = self._courier.session, self._position
            self._durably(lambda: self._outbox.append(session, items, position))
            self._pending += len(items)
        for ack in outputs.settle:
            self._settle(ack)

    def _hear_last_words(self) -> None:
        """A refusal whose acknowledgement was lost is told again in the answer to a question."""
        awaited = set(self._courier.sessions())
        self._uplink.ask(awaited)
        until_s = self._clock.monotonic_s() + LAST_WORD_S
        while awaited and self._clock.monotonic_s() < until_s and not self._stop.is_set():
            acks = self._uplink.take(TURN_S)
            awaited -= {ack.session for ack in acks}
            outputs = self._courier.step(Inputs(acks=acks), self._clock.monotonic_ns())
            self._keep(outputs, 0)
            self._diary.refusals(outputs.settle)

    def _settle(self, ack: Ack) -> None:
        refused = [(refusal.seq, refusal.reason) for refusal in ack.refused]
        session, contiguous = ack.session, ack.contiguous
        self._pending -= self._durably(lambda: self._outbox.settle(session, contiguous, refused))

    def _durably(self, write: Callable[[], T]) -> T:
        """What is to be on the disk; a source that cannot wait does not end for want of one."""
        while True:
            try:
                done = write()
            except StoreUnavailable as error:
                if self._source.patient or self._stop.is_set():
                    raise
                self._diary.outbox(str(error))
                self._pause(AGAIN_S)
            else:
                self._diary.outbox(None)
                return done

    def _pause(self, for_s: float) -> None:
        """What arrives meanwhile is kept for the next turn."""
        until_s = self._clock.monotonic_s() + for_s
        while not self._stop.is_set() and (left_s := until_s - self._clock.monotonic_s()) > 0.0:
            self._heard += self._uplink.take(left_s)

    def _tell(self, outputs: Outputs, connected: bool) -> None:
        self._diary.connection(connected, self._uplink.trouble)
        self._diary.service(outputs.silent)
        self._diary.refusals(outputs.settle)
        self._diary.shorn(outputs.shorn)
        self._diary.torn(outputs.torn)
        self._diary.malformed(self._uplink.malformed)
