"""The shell with a real outbox and a real journal; only the link is replaced."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from robot_agent.courier import Courier, Identity, Parcel
from robot_agent.diary import Diary
from robot_agent.process import new_session
from robot_agent.shell import BACKLOG, Shell
from robot_agent.sources.journal import JournalSource
from robot_agent.summary import Summary, summarise
from tagmap.errors import DataError
from tagmap.records import Ack
from tagmap.store.outbox import Outbox

Journal = Callable[[int], Path]


class WiredUplink:
    """Hands parcels straight to a ledger; `is_up` and `mutes` make it fail."""

    def __init__(self, ledger: Any) -> None:
        self.ledger = ledger
        self.is_up: Callable[[], bool] = lambda: True
        self.mutes: Callable[[Ack], bool] = lambda _: False
        self.stops: Callable[[], None] = lambda: None
        self.trouble = None
        self.malformed = 0
        self._acks: list[Ack] = []

    def connected(self) -> bool:
        self.stops()
        return self.is_up()

    def send(self, parcels: Iterable[Parcel]) -> None:
        before: dict[str, int] = {}
        for parcel in parcels:
            before.setdefault(parcel.session, self.ledger.contiguous.get(parcel.session, -1))
            self.ledger.take(parcel.payload)
        acks = [self.ledger.ack(session, after=last) for session, last in before.items()]
        self._acks += [ack for ack in acks if not self.mutes(ack)]

    def ask(self, sessions: Iterable[str]) -> None:
        self._acks += [self.ledger.ack(session) for session in sessions]

    def take(self, wait_s: float) -> list[Ack]:
        assert wait_s >= 0.0
        acks, self._acks = self._acks, []
        return acks

    def wake(self) -> None:
        pass


class Bench:
    """Runs agents, one after the other, on one outbox."""

    def __init__(self, path: Path, uplink: WiredUplink) -> None:
        self.outbox_path = path
        self.uplink = uplink

    def shell(self, outbox: Outbox, source: JournalSource) -> Shell:
        agent = Courier(Identity("site", "r1", 1, new_session()), source.introduction)
        diary = Diary("r1")
        return Shell(agent, source, outbox, self.uplink, diary)  # type: ignore[arg-type]

    def run(self, path: Path, stop_when: Callable[[], bool] = lambda: False) -> Summary:
        with Outbox.open(self.outbox_path) as outbox:
            shell = self.shell(outbox, JournalSource(path))
            self.uplink.stops = lambda: shell.stop() if stop_when() else None
            shell.run()
            if shell.damage is not None:
                raise shell.damage
            return summarise("r1", outbox.counts(), 0.0)


@pytest.fixture
def uplink(ledger: Any) -> WiredUplink:
    return WiredUplink(ledger)


@pytest.fixture
def bench(tmp_path: Path, uplink: WiredUplink) -> Bench:
    return Bench(tmp_path / "r1.outbox.db", uplink)


def test_a_journal_is_delivered_whole(bench: Bench, ledger: Any, journal: Journal) -> None:
    summary = bench.run(journal(3000))
    assert summary == Summary("r1", 1, 3000, 3000, 0, 0, 0.0)
    assert [keyframe.t_ns for keyframe in ledger.keyframes()] == list(range(3000))
    assert [keyframe.seq for keyframe in ledger.keyframes()] == list(range(1, 3001))


def test_an_empty_journal_still_says_hello(bench: Bench, ledger: Any, journal: Journal) -> None:
    assert bench.run(journal(0)) == Summary("r1", 1, 0, 0, 0, 0, 0.0)
    assert [hello.robot for hello in ledger.hellos()] == ["r1"]


def test_a_second_run_starts_where_the_first_was_stopped(
    bench: Bench, ledger: Any, journal: Journal
) -> None:
    path = journal(3000)
    first = bench.run(path, stop_when=lambda: len(ledger.stored) > 700)
    assert first.keyframes < 3000
    second = bench.run(path)
    assert (second.sessions, second.keyframes, second.pending) == (2, 3000, 0)
    assert sorted(keyframe.t_ns for keyframe in ledger.keyframes()) == list(range(3000))
    assert [keyframe.odom for keyframe in ledger.keyframes() if keyframe.seq == 1] == [None, None]


def test_a_finished_journal_is_not_sent_again_but_another_one_is(
    bench: Bench, journal: Journal
) -> None:
    bench.run(journal(30))
    assert bench.run(journal(30)).keyframes == 30
    assert bench.run(journal(31)).keyframes == 61


def test_refused_keyframes_are_settled_and_counted(
    bench: Bench, ledger: Any, journal: Journal
) -> None:
    ledger.refuses = lambda t_ns: t_ns % 10 == 3
    assert bench.run(journal(100)) == Summary("r1", 1, 100, 100, 10, 0, 0.0)
    with Outbox.open(bench.outbox_path) as outbox:
        assert {message.reason for message in outbox.refused()} == {"not wanted"}


def test_refusals_whose_acknowledgement_was_lost_are_learnt_at_the_end(
    bench: Bench, uplink: WiredUplink, ledger: Any, journal: Journal
) -> None:
    ledger.refuses = lambda t_ns: t_ns == 3
    uplink.mutes = lambda ack: bool(ack.refused)
    assert bench.run(journal(600)).refused == 1


def test_without_a_router_a_recording_waits(
    bench: Bench, uplink: WiredUplink, ledger: Any, journal: Journal
) -> None:
    """It is read a little ahead, and everything is sent when the router comes."""
    turns = iter(range(10**9))
    uplink.is_up = lambda: next(turns) > 20
    path = journal(5000)
    with Outbox.open(bench.outbox_path) as outbox:
        shell = bench.shell(outbox, JournalSource(path))
        uplink.stops = lambda: shell.stop() if next(turns) > 15 else None
        shell.run()
        assert BACKLOG <= outbox.counts().pending < 2 * BACKLOG
    assert ledger.stored == {}
    assert bench.run(path).pending == 0
    assert len(ledger.keyframes()) == 5000


def test_what_is_before_the_damage_is_delivered(
    bench: Bench, ledger: Any, journal: Journal
) -> None:
    path = journal(300)
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(DataError, match="observation 299 is cut short"):
        bench.run(path)
    assert len(ledger.keyframes()) == 299
    with Outbox.open(bench.outbox_path) as outbox:
        assert outbox.counts().pending == 0
