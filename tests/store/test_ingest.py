"""What goes in comes out: the same bits, once, in whatever order it came."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tagmap.errors import StoreError
from tagmap.records import Keyframe, encode
from tagmap.store import Batch, Counts, Inserted, MemoryRow, Reading, RefusalRow, SiteStore, Survey
from tagmap.store.check import check
from tests.store.records import SITE, hello, keyframe, keyframes

ROBOTS = {"r1": 1, "r2": 2}


@contextmanager
def fresh_store() -> Iterator[SiteStore]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "site.db"
        with SiteStore.open(path, SITE) as store:
            yield store
        assert check(path) == []


def refusal(seq: int, robot: str = "r1", reason: str = "bad") -> RefusalRow:
    return RefusalRow(robot, "session-1", seq, reason, t_ns=seq)


@settings(max_examples=40, deadline=None)
@given(st.lists(keyframes(), max_size=4, unique_by=lambda k: k.seq))
def test_keyframes_are_read_back_bit_for_bit(stored: list[Keyframe]) -> None:
    with fresh_store() as store:
        store.commit(Batch(keyframes=stored))
        assert [encode(k) for _, k in store.keyframes()] == [encode(k) for k in stored]
        in_order = sorted(stored, key=lambda k: k.seq)
        assert [encode(k) for k in store.keyframes_of("r1", "session-1")] == list(
            map(encode, in_order)
        )


def facts_of(store: SiteStore) -> dict[str, Any]:
    """Everything the store says, apart from the order in which it came."""
    sessions = sorted(store.sessions(), key=lambda s: (s.robot, s.session))
    return {
        "sessions": sessions,
        "keyframes": [store.keyframes_of(s.robot, s.session) for s in sessions],
        "settled": [store.settled(s.robot, s.session) for s in sessions],
        "refusals": sorted(store.refusals(), key=lambda r: (r.robot, r.seq)),
        "surveys": store.surveys(),
        "robots": store.robots(),
        "counts": store.counts(),
    }


@st.composite
def facts(draw: st.DrawFn) -> list[Batch]:
    """Single facts of two robots, in order: each seq has one verdict, some have none."""
    singles = [Batch(hellos=[hello(r, number=ROBOTS[r])]) for r in ROBOTS]
    for robot in ROBOTS:
        for seq in range(1, draw(st.integers(1, 6))):
            verdict = draw(st.sampled_from(["stored", "refused", "absent"]))
            if verdict == "stored":
                singles.append(Batch(keyframes=[draw(keyframes(robot=robot, seq=seq))]))
            elif verdict == "refused":
                singles.append(Batch(refusals=[refusal(seq, robot)]))
    times_ns = range(draw(st.integers(0, 3)))
    singles += [Batch(surveys=[Survey("tag1", (float(t), 0.0, 2.5), 0.01, t)]) for t in times_ns]
    return singles


def merged(batches: list[Batch]) -> Batch:
    return Batch(
        hellos=[x for b in batches for x in b.hellos],
        keyframes=[x for b in batches for x in b.keyframes],
        refusals=[x for b in batches for x in b.refusals],
        surveys=[x for b in batches for x in b.surveys],
    )


@settings(max_examples=30, deadline=None)
@given(facts(), st.data())
def test_order_and_repetition_make_no_difference(singles: list[Batch], data: st.DataObject) -> None:
    again = data.draw(st.lists(st.sampled_from(singles), max_size=5))
    shuffled = data.draw(st.permutations(singles + again))
    size = data.draw(st.integers(1, 5))
    with fresh_store() as once, fresh_store() as shaken:
        once.commit(merged(singles))
        for start in range(0, len(shuffled), size):
            shaken.commit(merged(shuffled[start : start + size]))
        assert facts_of(shaken) == facts_of(once)


def test_a_commit_says_how_much_of_it_was_new(tmp_path: Path) -> None:
    batch = Batch(
        hellos=[hello()],
        keyframes=[keyframe(1), keyframe(2), keyframe(2)],
        refusals=[refusal(3)],
        surveys=[Survey("tag1", (1.0, 2.0, 2.5), 0.01, 5)],
    )
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        assert store.commit(batch) == Inserted(1, 2, 4, 1, 1)
        assert store.commit(batch) == Inserted(0, 0, 0, 0, 0)
        assert store.commit(Batch()) == Inserted(0, 0, 0, 0, 0)
        assert store.settled("r1", "session-1") == [0, 1, 2, 3]
        assert store.counts() == Counts(1, 1, 2, 4, 1, 0, 0, 0, 0)


def test_a_duplicate_that_says_something_else_changes_nothing(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(keyframes=[keyframe(1, sightings=1)]))
        store.commit(Batch(keyframes=[keyframe(1, sightings=3)]))
        assert store.keyframes_of("r1", "session-1") == [keyframe(1, sightings=1)]


def test_keyframes_may_come_before_their_hello(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(keyframes=[keyframe(1)]))
        (early,) = store.sessions()
        assert (early.hello, early.number, store.settled("r1", "session-1")) == (None, None, [1])
        store.commit(Batch(hellos=[hello()]))
        (known,) = store.sessions()
        assert (known.hello, known.number, known.refused) == (hello(), 1, None)


def test_a_keyframe_refused_after_it_was_stored_is_withdrawn(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(keyframes=[keyframe(1), keyframe(2)]))
        store.commit(Batch(hellos=[hello()], refusals=[refusal(1, reason="needs a rig")]))
        assert store.keyframes_of("r1", "session-1") == [keyframe(2)]
        assert [k for _, k in store.keyframes()] == [keyframe(2)]
        assert (store.counts().keyframes, store.counts().sightings) == (1, 2)
        store.commit(Batch(keyframes=[keyframe(1)]))
        assert store.keyframes_of("r1", "session-1") == [keyframe(2)]
        assert store.settled("r1", "session-1") == [0, 1, 2]
    assert check(tmp_path / "site.db") == []


def test_within_a_batch_a_refusal_is_the_last_word(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(keyframes=[keyframe(1), keyframe(2)], refusals=[refusal(2)]))
        assert store.keyframes_of("r1", "session-1") == [keyframe(1)]
        assert store.settled("r1", "session-1") == [1, 2]
        assert store.counts().keyframes == 1
    assert check(tmp_path / "site.db") == []


def test_what_is_acceptable_at_last_takes_the_place_of_a_refusal(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(refusals=[refusal(0, reason="number 1 is taken"), refusal(1)]))
        (session,) = store.sessions()
        assert (session.hello, session.refused) == (None, "number 1 is taken")
        store.commit(Batch(hellos=[hello()], keyframes=[keyframe(1)]))
        assert store.refusals() == []
        assert store.sessions()[0].refused is None
        assert store.settled("r1", "session-1") == [0, 1]


def test_refusals_are_listed_newest_first_and_by_robot(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(refusals=[refusal(1), refusal(2), refusal(3, "r2")]))
        assert [r.seq for r in store.refusals()] == [3, 2, 1]
        assert store.refusals("r1", limit=1) == [refusal(2)]
        assert store.refusals("r1", "session-2") == []


def test_the_latest_survey_of_a_tag_counts(tmp_path: Path) -> None:
    new, old = Survey("tag1", (1.0, 2.0), 0.01, 20), Survey("tag1", (9.0, 9.0), 0.5, 10)
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(surveys=[new]))
        store.commit(Batch(surveys=[old, Survey("a", (0.0, 0.0), 0.1, 1)]))
        assert store.surveys() == [Survey("a", (0.0, 0.0), 0.1, 1), new]


def test_keyframes_are_read_on_from_where_one_stopped(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(keyframes=[keyframe(i) for i in range(1, 2302)]))
        rows = list(store.keyframes())
        assert [k.seq for _, k in rows] == list(range(1, 2302))
        store.commit(Batch(keyframes=[keyframe(1, "r2")]))
        assert [k.robot for _, k in store.keyframes(after_id=rows[-1][0])] == ["r2"]
        assert [k.seq for k in store.keyframes_of("r1", "session-1", from_seq=2300)] == [2300, 2301]


def test_the_store_may_be_written_while_its_keyframes_are_read(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(keyframes=[keyframe(i) for i in range(1, 1502)]))
        for _, one in store.keyframes():
            if one.seq == 500:
                store.commit(Batch(keyframes=[keyframe(1502)]))
        assert one.seq == 1502


def test_robots_are_summed_up_over_their_sessions(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(hellos=[hello()], keyframes=[keyframe(1), keyframe(2)]))
        late = keyframe(1, session="session-2", t_ns=7 * 10**9)
        store.commit(Batch(keyframes=[late], refusals=[refusal(9, "r0")]))
        r0, r1 = store.robots()
    assert (r0.robot, r0.number, r0.keyframes, r0.refusals, r0.last_t_ns) == (
        "r0",
        None,
        0,
        1,
        None,
    )
    assert (r1.sessions, r1.keyframes, r1.sightings, r1.refusals) == (2, 3, 6, 0)
    assert (r1.number, r1.last_t_ns) == (1, 7 * 10**9)


def test_a_number_that_another_robot_has_stores_nothing_of_the_batch(tmp_path: Path) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        store.commit(Batch(hellos=[hello()]))
        with pytest.raises(StoreError, match=r"robots\.number"):
            store.commit(Batch(hellos=[hello("r2", number=1)], keyframes=[keyframe(1)]))
        assert (store.counts().robots, store.counts().keyframes) == (1, 0)


@pytest.mark.parametrize(("seq", "reason"), [(2**63, "bad"), (7, "\ud800")])
def test_what_sqlite_cannot_hold_stores_nothing_of_the_batch(
    tmp_path: Path, seq: int, reason: str
) -> None:
    with SiteStore.open(tmp_path / "site.db", SITE) as store:
        with pytest.raises(StoreError, match="a value cannot be stored"):
            store.commit(Batch(keyframes=[keyframe(1)], refusals=[refusal(seq, reason=reason)]))
        assert store.counts().sessions == 0


@pytest.mark.parametrize(
    "table", ["keyframes", "sightings", "surveys", "map_versions", "tag_estimates"]
)
@pytest.mark.parametrize("statement", ["DELETE FROM {}", "UPDATE {} SET rowid = rowid"])
def test_facts_cannot_be_changed(mapped: SiteStore, table: str, statement: str) -> None:
    if table in ("sightings", "tag_estimates"):
        statement = statement.replace("rowid", "tag")
    with pytest.raises(StoreError, match=f"{table} is append-only"):
        mapped._db.execute(statement.format(table))


def test_a_session_has_one_hello(mapped: SiteStore) -> None:
    with pytest.raises(StoreError, match="a session has one hello"):
        mapped._db.execute("UPDATE sessions SET hello = x'00'")


def test_memories_are_as_they_were_last_read() -> None:
    with fresh_store() as store:
        assert store.memories() == []
        store.commit(Batch(readings=[Reading("b", "r1", b"old", 1), Reading("a", "r1", b"", 2)]))
        written = Reading("b", "r2", b"new", 3, job=7, outcome="written")
        store.commit(Batch(readings=[written, written]))
        lost = Reading("b", "r1", None, 4, job=8, outcome="failed", reason="no answer")
        store.commit(Batch(readings=[lost]))
        assert store.memories() == [MemoryRow("a", b"", 0), MemoryRow("b", b"new", 1)]
