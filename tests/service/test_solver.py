import queue

import pytest

from tagmap.service.solver import Failed, Solved, SolverProcess
from tagmap.store import Batch, SiteStore, Survey
from tests.mapping.messages import hello, keyframe

PATIENCE_S = 60.0


@pytest.fixture
def store(tmp_path):
    with SiteStore.open(tmp_path / "site.db", "site") as store:
        yield store


@pytest.fixture
def solving(store):
    """`solving(function)` gives order() and results of a process that calls it."""
    started = []

    def start(function):
        results = queue.Queue()
        name = f"tests.service.fakes:{function}"
        process = SolverProcess(store.path, "site", results.put, begin=name)
        started.append(process)
        return process, lambda: results.get(timeout=PATIENCE_S)

    yield start
    for process in started:
        process.stop()


def test_solves_what_is_committed_and_each_time_a_little_more(store, solving):
    process, result = solving("begin")
    process.order()
    assert result().solution is None
    store.commit(Batch(hellos=[hello()], keyframes=[keyframe(1), keyframe(2)]))
    process.order()
    first = result()
    assert isinstance(first, Solved)
    assert (first.extent.keyframes, first.extent.through_id) == (2, 2)
    store.commit(Batch(keyframes=[keyframe(3)], surveys=[Survey("6", (1.0, 2.0, 0.0), 0.1, 5)]))
    process.order()
    second = result()
    assert second.extent.keyframes == 3
    assert second.extent.surveys == (("6", 5),)
    assert second.solution.sessions[0].seqs.tolist() == [1, 2, 3]


def test_leaves_out_what_has_no_hello(store, solving):
    process, result = solving("begin")
    store.commit(
        Batch(hellos=[hello()], keyframes=[keyframe(1), keyframe(1, session="session-0002")])
    )
    process.order()
    assert [s.session for s in result().solution.sessions] == ["session-0001"]


def test_output_of_libraries_does_no_harm(store, solving):
    process, result = solving("talk")
    store.commit(Batch(hellos=[hello()], keyframes=[keyframe(1)]))
    process.order()
    assert isinstance(result(), Solved)


def test_an_exception_is_a_result_and_the_process_lives(store, solving):
    process, result = solving("fail")
    store.commit(Batch(hellos=[hello()], keyframes=[keyframe(1)]))
    process.order()
    assert result() == Failed("ValueError: these data are no good")
    pid = process.pid
    process.order()
    assert isinstance(result(), Failed)
    assert process.pid == pid


def test_a_process_that_died_is_reported_and_replaced(store, solving):
    process, result = solving("die")
    store.commit(Batch(hellos=[hello()], keyframes=[keyframe(1)]))
    for _ in range(2):
        process.order()
        failed = result()
        assert failed.died
        assert "status 3" in failed.reason


def test_stops_without_a_word(solving):
    process, _ = solving("begin")
    process.order()
    process.stop()
    assert process.pid is None
