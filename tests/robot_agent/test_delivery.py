"""Delivery as a whole: agents die, the service restarts, the wire loses, doubles and delays.

Everything is simulated in virtual time and repeats bit for bit from its seed.
"""

import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from hypothesis import given, settings
from hypothesis import strategies as st

from robot_agent.courier import WINDOW, Courier, Identity, Inputs, Outputs, Parcel, Room
from tagmap.records import Ack, Introduction, Keyframe, Observation, Refusal, Transform, decode

TICK_NS = 50_000_000
INTRODUCTION = Introduction(kind="planar", rig=None)
AT_BASE = Transform(p_m=(0.0, 0.0), theta_rad=0.0)


T = TypeVar("T")


@dataclass(frozen=True)
class Faults:
    lost: float
    doubled: float
    max_delay_ticks: int
    agent_dies: float
    service_restarts: float
    link_drops: float
    refused: float


class Wire(Generic[T]):
    """Delivers every message 0, 1 or 2 times, after a random delay, so out of order."""

    def __init__(self, faults: Faults, rng: random.Random) -> None:
        self.faults, self._rng = faults, rng
        self._under_way: list[tuple[int, T]] = []

    def put(self, message: T, tick: int) -> None:
        copies = 0 if self._rng.random() < self.faults.lost else 1
        copies += self._rng.random() < self.faults.doubled
        for _ in range(copies):
            self._under_way.append(
                (tick + self._rng.randint(0, self.faults.max_delay_ticks), message)
            )

    def arrived(self, tick: int) -> list[T]:
        due = [message for at, message in self._under_way if at <= tick]
        self._under_way = [(at, message) for at, message in self._under_way if at > tick]
        return due


@dataclass
class Service:
    """Stores what arrives; what it stored survives a restart, what it queued does not."""

    stored: dict[tuple[str, int], bytes] = field(default_factory=dict)
    refusals: dict[tuple[str, int], str] = field(default_factory=dict)

    def ingest(self, parcel: Parcel, refuse: bool) -> Ack:
        key = (parcel.session, parcel.seq)
        if refuse and parcel.seq > 0 and key not in self.stored:
            self.refusals[key] = "because"
        known = self.stored.setdefault(key, parcel.payload)
        assert known == parcel.payload, "one number, two different records"
        return self.ack(parcel.session)

    def ack(self, session: str) -> Ack:
        contiguous = -1
        while (session, contiguous + 1) in self.stored:
            contiguous += 1
        refused = tuple(
            Refusal(seq=seq, reason=why)
            for (of, seq), why in self.refusals.items()
            if of == session and seq <= contiguous
        )
        return Ack(session=session, contiguous=contiguous, refused=refused)


class World:
    """One robot's agents, one after the other, on one outbox; one service."""

    def __init__(self, observations: int, faults: Faults, seed: int) -> None:
        self.rng = random.Random(seed)
        self.faults = faults
        self.source = [
            Observation(t_ns=t, odom=None, T_base_cam=AT_BASE, sightings=())
            for t in range(observations)
        ]
        self.service = Service()
        self.up: Wire[Parcel] = Wire(faults, self.rng)
        self.down: Wire[Ack] = Wire(faults, self.rng)
        self.settled: dict[str, int] = {}
        self.sessions: list[str] = []
        self.rows: list[Parcel | None] = []
        self.cursor = 0
        self.sent: list[tuple[str, int]] = []
        self.start_agent()

    def start_agent(self) -> None:
        session = f"session-{len(self.sessions):04d}"
        self.sessions.append(session)
        self.courier = Courier(Identity("site", "r1", 1, session), INTRODUCTION)
        self.rows.append(self.courier.hello())
        self.loaded, self.room = 0, Room(0, 0)

    def run(self, ticks: int, faulty_ticks: int) -> int:
        """Faults stop after `faulty_ticks`; returns the tick at which everything was settled."""
        for tick in range(ticks):
            faulty = tick < faulty_ticks
            if not faulty:
                calm = Faults(0, 0, 1, 0, 0, 0, self.faults.refused)
                self.up.faults = self.down.faults = calm
            if faulty and self.rng.random() < self.faults.service_restarts:
                self.up.arrived(tick + self.faults.max_delay_ticks)
            for parcel in self.up.arrived(tick):
                self.down.put(
                    self.service.ingest(parcel, self.rng.random() < self.faults.refused), tick
                )
            connected = not (faulty and self.rng.random() < self.faults.link_drops)
            self.turn(tick, connected, dies=faulty and self.rng.random() < self.faults.agent_dies)
            if self.cursor == len(self.source) and not any(self.rows):
                return tick
        raise AssertionError(f"{sum(map(bool, self.rows))} parcels are never settled")

    def turn(self, tick: int, connected: bool, dies: bool) -> None:
        taken = self.source[self.cursor : self.cursor + self.rng.randint(0, 40)]
        outputs = self.courier.step(
            Inputs(
                observations=taken,
                parcels=self.load(),
                acks=self.down.arrived(tick),
                connected=connected,
            ),
            tick * TICK_NS,
        )
        for stage in self.obey(outputs, len(taken), tick, connected):
            if dies and stage >= self.rng.randint(0, 2):
                self.start_agent()
                return

    def load(self) -> Sequence[Parcel]:
        waiting = [(i, row) for i, row in enumerate(self.rows) if i >= self.loaded and row]
        parcels = self.room.fitting([row for _, row in waiting])
        if parcels:
            self.loaded = waiting[len(parcels) - 1][0] + 1
        return parcels

    def obey(self, outputs: Outputs, taken: int, tick: int, connected: bool) -> Iterator[int]:
        """Stops between its stages when the process is killed there."""
        yield 0
        self.rows.extend(outputs.append)
        self.cursor += taken
        yield 1
        self.settle(outputs.settle)
        for parcel in outputs.send:
            assert parcel in self.rows or self.settled[parcel.session] >= parcel.seq
            self.sent.append((parcel.session, parcel.seq))
            if connected:
                self.up.put(parcel, tick)
        for session in outputs.ask:
            if self.rng.random() >= self.up.faults.lost:
                self.down.put(self.service.ack(session), tick)
        self.room = outputs.room
        assert 0 <= self.room.parcels <= WINDOW
        yield 2

    def settle(self, acks: Sequence[Ack]) -> None:
        for ack in acks:
            last = self.settled[ack.session] = max(
                ack.contiguous, self.settled.get(ack.session, -1)
            )
            self.rows = [
                None if row is None or (row.session == ack.session and row.seq <= last) else row
                for row in self.rows
            ]


probability = st.floats(0.0, 0.5)


@settings(max_examples=60, deadline=None)
@given(
    observations=st.integers(0, 600),
    seed=st.integers(0, 2**32),
    faults=st.builds(
        Faults,
        lost=probability,
        doubled=probability,
        max_delay_ticks=st.integers(0, 60),
        agent_dies=st.floats(0.0, 0.05),
        service_restarts=st.floats(0.0, 0.1),
        link_drops=st.floats(0.0, 0.3),
        refused=st.floats(0.0, 0.2),
    ),
)
def test_everything_is_settled_and_nothing_becomes_two_records(
    observations: int, seed: int, faults: Faults
) -> None:
    world = World(observations, faults, seed)
    world.run(ticks=20_000, faulty_ticks=400)

    begun: set[str] = set()
    for session, seq in world.sent:
        assert seq == 0 or session in begun, "a session that does not begin with its hello"
        begun.add(session)
    keyframes = [
        decode(Keyframe, payload) for (_, seq), payload in world.service.stored.items() if seq > 0
    ]
    assert sorted(keyframe.t_ns for keyframe in keyframes) == list(range(observations))
    for session in world.sessions:
        assert (session, 0) in world.service.stored


def test_a_calm_wire_needs_every_parcel_once() -> None:
    world = World(2000, Faults(0, 0, 0, 0, 0, 0, 0), seed=1)
    world.run(ticks=2000, faulty_ticks=0)
    assert world.sent == [(world.sessions[0], seq) for seq in range(2001)]
