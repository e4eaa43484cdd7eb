"""Replay of journals: complete, damaged, paced, resumed."""

from collections.abc import Callable
from pathlib import Path

import pytest

from robot_agent.sources.journal import JournalSource
from tagmap.errors import DataError
from tagmap.records import Introduction, Observation, Transform
from tagmap.records.journal import write_journal

AT_BASE = Transform(p_m=(0.0, 0.0), theta_rad=0.0)
SECOND_NS = 1_000_000_000
NOON_NS = 43_200 * SECOND_NS

Write = Callable[[int], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(count: int) -> Path:
        """One observation a second from noon on."""
        path = tmp_path / f"{count}.journal"
        observations = (
            Observation(t_ns=NOON_NS + i * SECOND_NS, odom=None, T_base_cam=AT_BASE, sightings=())
            for i in range(count)
        )
        write_journal(path, Introduction(kind="planar", rig=None), observations)
        return path

    return write


def second_of(observation: Observation) -> int:
    return (observation.t_ns - NOON_NS) // SECOND_NS


def test_without_a_pace_everything_is_due_in_chunks(write: Write) -> None:
    source = JournalSource(write(10))
    assert source.patient
    assert [second_of(o) for o in source.take(4, now_ns=0)] == [0, 1, 2, 3]
    assert [second_of(o) for o in source.take(100, now_ns=0)] == [4, 5, 6, 7, 8, 9]
    assert source.exhausted


@pytest.mark.parametrize("speed", [0.5, 1.0, 20.0])
def test_paced_observations_come_when_their_time_has_come(write: Write, speed: float) -> None:
    source = JournalSource(write(5), speed)
    assert not source.patient
    start_ns = 77 * SECOND_NS
    assert [second_of(o) for o in source.take(100, start_ns)] == [0]
    assert source.take(100, start_ns + int(0.9 * SECOND_NS / speed)) == []
    later_ns = start_ns + int(2.1 * SECOND_NS / speed)
    assert [second_of(o) for o in source.take(100, later_ns)] == [1, 2]
    assert not source.exhausted


def test_a_resumed_replay_starts_its_clock_at_the_first_observation_it_plays(write: Write) -> None:
    source = JournalSource(write(5), speed=1.0)
    source.seek(3)
    assert [second_of(o) for o in source.take(100, now_ns=5)] == [3]
    assert [second_of(o) for o in source.take(100, now_ns=5 + SECOND_NS)] == [4]
    assert source.exhausted


def test_an_empty_journal_is_exhausted(write: Write) -> None:
    assert JournalSource(write(0)).exhausted


def test_seeking_past_the_end_leaves_nothing(write: Write) -> None:
    source = JournalSource(write(3))
    source.seek(3)
    assert source.exhausted


def test_the_fingerprint_is_of_the_content(write: Write, tmp_path: Path) -> None:
    path = write(3)
    copy = tmp_path / "copy"
    copy.write_bytes(path.read_bytes())
    assert JournalSource(copy).fingerprint == JournalSource(path).fingerprint
    assert JournalSource(write(4)).fingerprint != JournalSource(path).fingerprint


def test_what_is_before_the_damage_is_played_then_the_damage_is_told_once(write: Write) -> None:
    path = write(5)
    path.write_bytes(path.read_bytes()[:-1])
    source = JournalSource(path)
    assert [second_of(o) for o in source.take(100, now_ns=0)] == [0, 1, 2, 3]
    assert not source.exhausted
    with pytest.raises(DataError, match="observation 4 is cut short"):
        source.take(100, now_ns=0)
    assert source.exhausted
    assert source.take(100, now_ns=0) == []


def test_a_damaged_length_is_told_and_not_believed(write: Write) -> None:
    path = write(1)
    with path.open("ab") as file:
        file.write(b"\xff\xff\xff\xff")
    source = JournalSource(path)
    source.take(100, now_ns=0)
    with pytest.raises(DataError, match="observation 1 claims 4294967295 bytes"):
        source.take(100, now_ns=0)


@pytest.mark.parametrize("content", [b"", b"not a journal, but long enough to be one"])
def test_what_is_no_journal_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x"
    path.write_bytes(content)
    with pytest.raises(DataError, match="x: not an observation journal"):
        JournalSource(path)


def test_a_missing_journal_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="absent: cannot be read: No such file"):
        JournalSource(tmp_path / "absent")
