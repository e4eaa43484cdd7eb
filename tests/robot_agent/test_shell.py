"""The shell with a real outbox and a real journal; only the link is replaced."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from robot_agent.courier import Courier, Identity, Parcel
from robot_agent.diary import Diary
from robot_agent.process import new_session
from robot_agent.shell import BACKLOG, Shell
from robot_agent.sources import Source
from robot_agent.sources.journal import JournalSource
from robot_agent.sources.sensors import SensorSource
from robot_agent.summary import Summary, summarise
from tagmap import logs
from tagmap.errors import DataError, StoreUnavailable
from tagmap.records import Ack, Introduction, Observation, Transform
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

    def shell(self, outbox: Outbox, source: Source) -> Shell:
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


class FullDisk(Outbox):
    """For as many writes as `full` says."""

    full = 0
    tries = 0

    def append(self, session: str, items: Any, cursor: int) -> None:
        self._write()
        super().append(session, items, cursor)

    def settle(self, *args: Any) -> int:
        self._write()
        return super().settle(*args)

    def _write(self) -> None:
        self.tries += 1
        if self.full:
            self.full -= 1
            raise StoreUnavailable("r1.outbox.db: the disk is full")


def test_a_robot_that_senses_outlives_a_full_disk(
    bench: Bench, ledger: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is lost, nothing is numbered twice, and it is told once."""
    monkeypatch.setattr("robot_agent.shell.AGAIN_S", 0.001)
    logs.configure()
    source = SensorSource(Introduction(kind="planar", rig=None), "session-0001")
    for t_ns in range(300):
        at = Transform(p_m=(0.0, 0.0), theta_rad=0.0)
        source.put(Observation(t_ns=t_ns, odom=None, T_base_cam=at, sightings=()))
    source.end()
    with FullDisk.open(bench.outbox_path) as outbox:
        outbox.full = 7
        bench.shell(outbox, source).run()
        counts = outbox.counts()
    assert (counts.keyframes, counts.pending) == (300, 0)
    assert [keyframe.t_ns for keyframe in ledger.keyframes()] == list(range(300))
    assert ledger.contradictions == 0
    log = capsys.readouterr().err
    assert log.count("the outbox cannot be written") == 1
    assert log.count("the outbox can be written again") == 1


def test_a_robot_that_is_to_end_does_not_wait_for_the_disk(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robot_agent.shell.AGAIN_S", 0.001)
    source = SensorSource(Introduction(kind="planar", rig=None), "session-0001")
    at = Transform(p_m=(0.0, 0.0), theta_rad=0.0)
    source.put(Observation(t_ns=1, odom=None, T_base_cam=at, sightings=()))
    with FullDisk.open(bench.outbox_path) as outbox:
        outbox.full = 10**9
        shell = bench.shell(outbox, source)
        taken = bench.uplink.take

        def take(wait_s: float) -> list[Ack]:
            if outbox.tries > 3:
                shell.stop()
            return taken(wait_s)

        monkeypatch.setattr(bench.uplink, "take", take)
        with pytest.raises(StoreUnavailable, match="the disk is full"):
            shell.run()


def test_a_recording_that_can_be_sent_again_ends_for_a_full_disk(
    bench: Bench, journal: Journal
) -> None:
    with FullDisk.open(bench.outbox_path) as outbox:
        outbox.full = 1
        with pytest.raises(StoreUnavailable, match="the disk is full"):
            bench.shell(outbox, JournalSource(journal(10))).run()
