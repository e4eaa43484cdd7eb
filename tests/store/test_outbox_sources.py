"""Whose an outbox is, which source its cursor is of, and refusals that are told late."""

from pathlib import Path

import pytest

from tagmap.errors import StoreError
from tagmap.store.outbox import Outbox, RefusedMessage

SESSION = "session-1"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "outbox.db"


def test_each_source_has_its_own_cursor(path: Path) -> None:
    with Outbox.open(path) as outbox:
        outbox.start_session(SESSION, b"hello")
        assert outbox.resume("morning") == 0
        outbox.append(SESSION, [(1, b"a"), (2, b"b")], cursor=2)
        assert outbox.resume("noon") == 0
        outbox.append(SESSION, [(3, b"c")], cursor=1)
    with Outbox.open(path) as outbox:
        assert outbox.resume("noon") == 1
        assert outbox.resume("morning") == 2


def test_the_outbox_of_another_robot_is_refused(path: Path) -> None:
    Outbox.open(path, "site/r1").close()
    Outbox.open(path, "site/r1").close()
    with pytest.raises(StoreError, match="the outbox of site/r1, not of site/r2"):
        Outbox.open(path, "site/r2")


def test_a_refusal_told_late_or_again_is_counted_once(path: Path) -> None:
    with Outbox.open(path) as outbox:
        outbox.start_session(SESSION, b"hello")
        outbox.append(SESSION, [(1, b"a"), (2, b"b"), (3, b"c")], cursor=3)
        assert outbox.settle(SESSION, 2, [(2, "bad")]) == 3
        assert outbox.settle(SESSION, 2, [(2, "bad"), (1, "late")]) == 0
        assert outbox.refused() == [
            RefusedMessage(SESSION, 1, "late", None),
            RefusedMessage(SESSION, 2, "bad", b"b"),
        ]
        assert outbox.counts().pending == 1


def test_a_refusal_of_what_was_never_appended_is_ignored(path: Path) -> None:
    with Outbox.open(path) as outbox:
        outbox.start_session(SESSION, b"hello")
        assert outbox.settle(SESSION, -1, [(7, "what?")]) == 0
        assert outbox.refused() == []


def test_hellos_are_counted_apart(path: Path) -> None:
    with Outbox.open(path) as outbox:
        outbox.start_session(SESSION, b"hello")
        outbox.append(SESSION, [(1, b"a")], cursor=1)
        assert outbox.counts().pending_hellos == 1
        outbox.settle(SESSION, 0, [(0, "unwanted")])
        counts = outbox.counts()
    assert (counts.refused, counts.refused_hellos) == (1, 1)
    assert (counts.pending, counts.pending_hellos) == (1, 0)
