"""Delivery, without I/O: observations become keyframes, keyframes become settled facts.

The shell obeys every `Outputs` in the order of its fields. `append` is durable before anything of
it is sent, therefore a record that was ever on the wire keeps its number for ever; what is sent
comes back in only through `Inputs.parcels`, from the outbox, so the records of this session and
the leftovers of earlier ones take the same way.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate

import msgspec

from robot_agent.flight import Flight, Parcel
from tagmap.errors import DataError
from tagmap.records import Ack, Hello, Introduction, Keyframe, Observation, encode
from tagmap.records.codec import MAX_BYTES

WINDOW = 256
WINDOW_BYTES = MAX_BYTES
"""Half of what a Zenoh link queues before it drops: a full window may be sent in one go."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Whose records these are. `session` is new at every start of an agent."""

    site: str
    robot: str
    number: int
    session: str


@dataclass(frozen=True, slots=True)
class Inputs:
    """What happened since the last step.

    observations  read from the source, in order
    parcels       read from the outbox, oldest first, never the same one twice
    acks          from the service, put or answered, in any order, late or repeated
    connected     whether a router is reachable now
    """

    observations: Sequence[Observation] = ()
    parcels: Sequence[Parcel] = ()
    acks: Sequence[Ack] = ()
    connected: bool = True


@dataclass(frozen=True, slots=True)
class Room:
    """With nothing under way, every parcel that can be decoded fits."""

    parcels: int
    bytes: int

    def fitting(self, parcels: Sequence[Parcel]) -> Sequence[Parcel]:
        """The first of `parcels`, as many as there is room for."""
        totals = accumulate(len(parcel.payload) for parcel in parcels)
        return parcels[: min(self.parcels, sum(total <= self.bytes for total in totals))]


@dataclass(frozen=True, slots=True)
class Outputs:
    """What to do now, in this order.

    append  make durable, in one transaction with the position in the source
    settle  at most one acknowledgement per session: forget what it settles
    send    put on the wire; hello first, ascending within a session
    ask     sessions whose acknowledgement to query
    room    what the next step can take from the outbox
    silent  whether the service leaves questions unanswered
    shorn   seqs in `append` that were too large for the wire with their sightings
    torn    sessions of which the service lacks what it had acknowledged; they cannot be settled
    """

    append: Sequence[Parcel]
    settle: Sequence[Ack]
    send: Sequence[Parcel]
    ask: Sequence[str]
    room: Room
    silent: bool
    shorn: Sequence[int]
    torn: Sequence[str]


class Courier:
    """Numbers the observations of one session and sees all sessions' records settled."""

    def __init__(self, identity: Identity, introduction: Introduction) -> None:
        self._identity = identity
        self._introduction = introduction
        self._seq = 0
        self._flights: dict[str, Flight] = {}
        self._connected = False

    @property
    def session(self) -> str:
        return self._identity.session

    def sessions(self) -> Sequence[str]:
        """Those of which something was sent, this one and earlier ones."""
        return list(self._flights)

    def hello(self) -> Parcel:
        """Seq 0 of the session; the shell opens the session in the outbox with it.

        Raises DataError when the introduction is too large for the wire.
        """
        hello = Hello(
            **msgspec.structs.asdict(self._introduction),
            site=self._identity.site,
            robot=self._identity.robot,
            number=self._identity.number,
            session=self.session,
        )
        payload = encode(hello)
        if len(payload) > MAX_BYTES:
            raise DataError(
                f"introduction of {len(payload)} bytes, at most {MAX_BYTES} can be sent"
            )
        return Parcel(self.session, hello.seq, payload)

    def step(self, inputs: Inputs, now_ns: int) -> Outputs:
        """`now_ns` is monotonic."""
        self._notice_connection(inputs.connected, now_ns)
        append, shorn = self._number(inputs.observations)
        settle, missing = self._acknowledge(inputs.acks, now_ns)
        self._launch(inputs.parcels, now_ns)
        return Outputs(
            append=append,
            settle=settle,
            send=[*missing, *inputs.parcels],
            ask=self._questions(now_ns),
            room=self._room(),
            silent=any(flight.unanswered > 1 for flight in self._flights.values()),
            shorn=shorn,
            torn=[ack.session for ack in inputs.acks if self._is_torn(ack)],
        )

    def _notice_connection(self, connected: bool, now_ns: int) -> None:
        if connected and not self._connected:
            for flight in self._flights.values():
                flight.ask_now(now_ns)
        self._connected = connected

    def _number(
        self, observations: Iterable[Observation]
    ) -> tuple[Sequence[Parcel], Sequence[int]]:
        """A keyframe that nobody could decode goes without sightings: the odometry chain holds."""
        append: list[Parcel] = []
        shorn: list[int] = []
        for observation in observations:
            keyframe = self._keyframe(observation)
            payload = encode(keyframe)
            if len(payload) > MAX_BYTES:
                payload = encode(msgspec.structs.replace(keyframe, sightings=()))
                shorn.append(keyframe.seq)
            append.append(Parcel(self.session, keyframe.seq, payload))
        return append, shorn

    def _keyframe(self, observation: Observation) -> Keyframe:
        """The first keyframe of a session has no odometry: nothing of this session is before it."""
        self._seq += 1
        return Keyframe(
            site=self._identity.site,
            robot=self._identity.robot,
            session=self.session,
            seq=self._seq,
            t_ns=observation.t_ns,
            odom=observation.odom if self._seq > 1 else None,
            T_base_cam=observation.T_base_cam,
            sightings=observation.sightings,
        )

    def _acknowledge(
        self, acks: Iterable[Ack], now_ns: int
    ) -> tuple[Sequence[Ack], Sequence[Parcel]]:
        """What to settle, and what is missing at the service."""
        settle: list[Ack] = []
        missing: list[Parcel] = []
        for ack in _newest(acks):
            flight = self._flights.get(ack.session)
            if flight is None:
                continue
            last = self._credible(ack, flight)
            progress, again = flight.acknowledge(last, now_ns)
            refused = flight.news(refusal for refusal in ack.refused if refusal.seq <= last)
            missing.extend(again)
            if progress or refused:
                settle.append(Ack(session=ack.session, contiguous=last, refused=refused))
        return settle, missing

    def _credible(self, ack: Ack, flight: Flight) -> int:
        """Of this session nothing can be settled that was not sent yet, whatever is claimed."""
        if ack.session == self.session:
            return min(ack.contiguous, flight.last_sent)
        return ack.contiguous

    def _is_torn(self, ack: Ack) -> bool:
        flight = self._flights.get(ack.session)
        return flight is not None and flight.is_gap_before(ack.contiguous)

    def _launch(self, parcels: Iterable[Parcel], now_ns: int) -> None:
        for parcel in parcels:
            self._flights.setdefault(parcel.session, Flight()).launch(parcel, now_ns)

    def _questions(self, now_ns: int) -> Sequence[str]:
        if not self._connected:
            return []
        return [session for session, flight in self._flights.items() if flight.asks(now_ns)]

    def _room(self) -> Room:
        if not self._connected:
            return Room(0, 0)
        sizes = [
            len(parcel.payload)
            for flight in self._flights.values()
            for parcel in flight.parcels.values()
        ]
        return Room(max(WINDOW - len(sizes), 0), max(WINDOW_BYTES - sum(sizes), 0))


def _newest(acks: Iterable[Ack]) -> Iterable[Ack]:
    """One acknowledgement per session: the furthest, with the refusals of all."""
    merged: dict[str, Ack] = {}
    for ack in acks:
        seen = merged.get(ack.session, ack)
        refused = {refusal.seq: refusal for refusal in (*seen.refused, *ack.refused)}
        merged[ack.session] = Ack(
            session=ack.session,
            contiguous=max(seen.contiguous, ack.contiguous),
            refused=tuple(refused.values()),
        )
    return merged.values()
