"""The outbox: messages until they are settled, in step with their source."""

from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test

from tagmap.errors import StoreError
from tagmap.store import Outbox, OutboxCounts, RefusedMessage, SiteStore

SESSION = "session-1"


@pytest.fixture
def outbox(path: Path) -> Outbox:
    outbox = Outbox.open(path)
    outbox.start_session(SESSION, b"hello")
    outbox.append(SESSION, [(1, b"a"), (2, b"b"), (3, b"c")], cursor=30)
    return outbox


def test_a_new_outbox_is_empty(path: Path) -> None:
    with Outbox.open(path) as outbox:
        assert outbox.cursor() == 0
        assert outbox.unsettled(10) == []
        assert outbox.counts() == OutboxCounts(0, 0, 0, 0, 0, 0, 0)


def test_messages_come_oldest_first_and_page_by_page(outbox: Outbox) -> None:
    outbox.start_session("a-later-one", b"hi")
    first = outbox.unsettled(3)
    assert first == [(SESSION, 0, b"hello"), (SESSION, 1, b"a"), (SESSION, 2, b"b")]
    assert outbox.unsettled(3, after=(SESSION, 2)) == [
        (SESSION, 3, b"c"),
        ("a-later-one", 0, b"hi"),
    ]
    assert outbox.pending_sessions() == [SESSION, "a-later-one"]


def test_everything_is_there_after_reopening(outbox: Outbox, path: Path) -> None:
    before = (outbox.cursor(), outbox.counts(), outbox.unsettled(10))
    outbox.close()
    with Outbox.open(path) as again:
        assert (again.cursor(), again.counts(), again.unsettled(10)) == before


def test_what_is_settled_is_dropped_and_still_counted(outbox: Outbox) -> None:
    assert outbox.settle(SESSION, 1) == 2
    assert outbox.settle(SESSION, 1) == 0
    assert outbox.unsettled(10) == [(SESSION, 2, b"b"), (SESSION, 3, b"c")]
    counts = outbox.counts()
    assert (counts.appended, counts.settled, counts.pending, counts.keyframes) == (4, 2, 2, 3)


def test_what_is_refused_stays_visible(outbox: Outbox) -> None:
    assert outbox.settle(SESSION, 0, [(2, "cov is not positive definite")]) == 2
    refused = RefusedMessage(SESSION, 2, "cov is not positive definite", b"b")
    assert outbox.refused() == [refused]
    assert [seq for _, seq, _ in outbox.unsettled(10)] == [1, 3]
    assert (outbox.counts().settled, outbox.counts().refused) == (2, 1)


def test_an_acknowledgement_of_an_unknown_session_is_ignored(outbox: Outbox) -> None:
    assert outbox.settle("session-9", 100, [(1, "bad")]) == 0
    assert outbox.counts().pending == 4


@pytest.mark.parametrize("seqs", [[5], [3], [4, 6], [0]])
def test_gaps_and_repetitions_are_refused_as_a_whole(outbox: Outbox, seqs: list[int]) -> None:
    with pytest.raises(StoreError, match="session session-1 ends at seq 3"):
        outbox.append(SESSION, [(seq, b"x") for seq in seqs], cursor=99)
    assert outbox.cursor() == 30
    assert outbox.counts().appended == 4


def test_sessions_are_started_once_and_before_they_are_used(outbox: Outbox) -> None:
    with pytest.raises(StoreError, match="was started before"):
        outbox.start_session(SESSION, b"again")
    with pytest.raises(StoreError, match="no session session-2"):
        outbox.append("session-2", [(1, b"x")], cursor=31)
    with pytest.raises(StoreError, match="no session session-2"):
        outbox.unsettled(10, after=("session-2", 0))


def test_the_cursor_moves_without_messages(outbox: Outbox) -> None:
    outbox.append(SESSION, [], cursor=31)
    assert outbox.cursor() == 31


def test_a_site_database_is_not_an_outbox(path: Path) -> None:
    SiteStore.open(path, "site").close()
    with pytest.raises(StoreError, match="not a tagmap outbox database"):
        Outbox.open(path)


def test_two_agents_cannot_share_one(outbox: Outbox, path: Path) -> None:
    with pytest.raises(StoreError, match="another process is writing to it"):
        Outbox.open(path)
    outbox.close()
    Outbox.open(path).close()


def test_any_sequence_of_events_accounts_for_every_message(tmp_path: Path) -> None:
    class Machine(RuleBasedStateMachine):
        """The outbox against two dictionaries, closed and opened again at any time."""

        runs = 0

        def __init__(self) -> None:
            super().__init__()
            Machine.runs += 1
            self.path = tmp_path / f"{Machine.runs}.db"
            self.outbox = Outbox.open(self.path)
            self.pending: dict[tuple[str, int], bytes] = {}
            self.lengths: dict[str, int] = {}

        @rule()
        def restart(self) -> None:
            self.outbox.close()
            self.outbox = Outbox.open(self.path)
            session = f"session-{len(self.lengths)}"
            self.outbox.start_session(session, b"hello")
            self.lengths[session] = 1
            self.pending[session, 0] = b"hello"

        @rule(n=st.integers(0, 5))
        def append(self, n: int) -> None:
            if self.lengths:
                session, start = list(self.lengths.items())[-1]
                items = [(start + i, bytes([i])) for i in range(n)]
                self.outbox.append(session, items, cursor=start + n)
                self.lengths[session] += n
                self.pending |= {(session, seq): payload for seq, payload in items}

        @rule(data=st.data())
        def settle(self, data: st.DataObject) -> None:
            if self.lengths:
                session = data.draw(st.sampled_from(list(self.lengths)))
                contiguous = data.draw(st.integers(-1, self.lengths[session]))
                refused = data.draw(st.lists(st.integers(0, 12), max_size=3))
                settled = [
                    key
                    for key in self.pending
                    if key[0] == session and (key[1] <= contiguous or key[1] in refused)
                ]
                reasons = [(seq, "bad") for seq in refused]
                assert self.outbox.settle(session, contiguous, reasons) == len(settled)
                for key in settled:
                    del self.pending[key]

        @invariant()
        def agrees(self) -> None:
            rows = self.outbox.unsettled(1000)
            assert {(session, seq): payload for session, seq, payload in rows} == self.pending
            counts = self.outbox.counts()
            assert counts.appended == sum(self.lengths.values())
            assert counts.appended == counts.settled + counts.pending
            assert counts.pending == len(rows)

        def teardown(self) -> None:
            self.outbox.close()

    small = settings(max_examples=15, stateful_step_count=15, deadline=None)
    run_state_machine_as_test(Machine, settings=small)
