"""Journals as load: dealt out in turn, numbered anew, and refused where they are none."""

from pathlib import Path

import pytest

from fleet.load.recorded import recorded
from fleet.load.swarm import swarm
from tagmap.errors import DataError
from tagmap.records import Introduction, Observation
from tagmap.records.journal import write_journal


def journal(path: Path, keyframes: int, seed: int = 1) -> list[Observation]:
    """What one robot of a swarm measured."""
    [member] = swarm(seed, 1, keyframes, 10.0, "site")
    observations = [
        Observation(**{name: getattr(k, name) for name in Observation.__struct_fields__})
        for k in member.keyframes
    ]
    introduction = Introduction(kind="spatial", rig=member.hello.rig)
    write_journal(path, introduction, observations)
    return observations


def test_each_robot_sends_a_journal_of_its_own(tmp_path: Path):
    first, second = (journal(tmp_path / f"{n}.journal", 5, n) for n in (1, 2))
    one, two, three = recorded(tmp_path, 3, "load")
    assert [s.hello.robot for s in (one, two, three)] == ["r1", "r2", "r3"]
    sent = [*one.drive(3, 10.0), *one.drive(3, 20.0)]
    assert [k.seq for k in sent] == [1, 2, 3, 4, 5]
    assert [k.sightings for k in sent] == [o.sightings for o in first]
    assert [k.odom for k in sent] == [o.odom for o in first]
    assert [k.sightings for k in two.drive(9, 10.0)] == [o.sightings for o in second]
    assert [(k.robot, k.sightings) for k in three.drive(1, 10.0)] == [("r3", first[0].sightings)]
    assert len(recorded(tmp_path, None, "load")) == 2


def test_a_folder_without_journals(tmp_path: Path):
    with pytest.raises(DataError, match=r"no \*.journal in it"):
        recorded(tmp_path, None, "load")


def test_what_is_no_journal(tmp_path: Path):
    (tmp_path / "a.journal").write_text("something")
    with pytest.raises(DataError, match="not an observation journal"):
        recorded(tmp_path, None, "load")


def test_journals_of_different_kinds(tmp_path: Path):
    journal(tmp_path / "a.journal", 1)
    write_journal(tmp_path / "b.journal", Introduction(kind="planar", rig=None), [])
    with pytest.raises(DataError, match=r"planar, a\.journal is spatial"):
        recorded(tmp_path, None, "load")
