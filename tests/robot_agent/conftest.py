"""Journals, and a service that only stores and acknowledges."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tagmap.records import (
    Ack,
    Hello,
    Introduction,
    Keyframe,
    Measurement,
    Observation,
    Odometry,
    Refusal,
    Sighting,
    Transform,
    address_of,
    decode,
)
from tagmap.records.journal import write_journal

STEP = Odometry(
    T_prev_cur=Transform(p_m=(0.1, 0.0), theta_rad=0.0), cov=(1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)
)
SIGHTING = Sighting(
    tag="a",
    id_by="given",
    p_false=0.0,
    z=Measurement(range_m=1.0, bearing_rad=0.0, cov=(0.01, 0.0, 0.01)),
)


def _observations(count: int) -> Iterator[Observation]:
    for t_ns in range(count):
        yield Observation(
            t_ns=t_ns,
            odom=STEP,
            T_base_cam=Transform(p_m=(0.0, 0.0), theta_rad=0.0),
            sightings=(SIGHTING, SIGHTING),
        )


@pytest.fixture
def journal(tmp_path: Path) -> Callable[[int], Path]:
    """Writes a journal of so many observations; their t_ns count from 0."""

    def write(count: int) -> Path:
        path = tmp_path / f"{count}.journal"
        write_journal(path, Introduction(kind="planar", rig=None), _observations(count))
        return path

    return write


@dataclass
class Ledger:
    """What a service has stored. `refuses` names the t_ns that it does not want."""

    refuses: Callable[[int], bool] = lambda _: False
    stored: dict[tuple[str, int], bytes] = field(default_factory=dict)
    refused: dict[tuple[str, int], str] = field(default_factory=dict)
    contiguous: dict[str, int] = field(default_factory=dict)
    first: dict[str, int] = field(default_factory=dict)
    contradictions: int = 0

    def take(self, payload: bytes) -> str:
        """Its session."""
        address = address_of(payload)
        assert address is not None
        key = (address.session, address.seq)
        self.first.setdefault(address.session, address.seq)
        if key not in self.stored and address.seq and self.refuses(decode(Keyframe, payload).t_ns):
            self.refused[key] = "not wanted"
        if self.stored.setdefault(key, payload) != payload:
            self.contradictions += 1
        last = self.contiguous.get(address.session, -1)
        while (address.session, last + 1) in self.stored:
            last += 1
        self.contiguous[address.session] = last
        return address.session

    def ack(self, session: str, after: int = -1) -> Ack:
        """With the refusals behind `after`."""
        last = self.contiguous.get(session, -1)
        return Ack(
            session=session,
            contiguous=last,
            refused=tuple(
                Refusal(seq=seq, reason=reason)
                for (of, seq), reason in self.refused.items()
                if of == session and after < seq <= last
            ),
        )

    def hellos(self) -> list[Hello]:
        return [decode(Hello, p) for (_, seq), p in self.stored.items() if seq == 0]

    def keyframes(self) -> list[Keyframe]:
        return [decode(Keyframe, p) for (_, seq), p in self.stored.items() if seq > 0]


@pytest.fixture
def ledger() -> Ledger:
    return Ledger()
