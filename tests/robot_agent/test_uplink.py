"""A robot's link to a real router: leases, jobs and the map, with a service and without."""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import msgspec
import pytest

from robot_agent.uplink import Route, Uplink
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import (
    JobResult,
    LeaseReply,
    LeaseRequest,
    MapVersion,
    Tag,
    WriteJob,
    decode,
    encode,
)

Eventually = Callable[[Callable[[], object]], None]
KEYS = Keys("site")
ASK = LeaseRequest(robot="r1", wanted_s=1.0)
VERSION = MapVersion(
    version=3, t_ns=1, cause="test", gauge="anchored", moved=None, tags=1, withheld=0
)
TAG = Tag(
    tag="a",
    p_m=(1.0, 2.0, 3.0),
    cov=(1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4),
    state="mapped",
    n=1,
    version=3,
    gauge="anchored",
)
JOB = WriteJob(job=1, tag="a", record=b"r", valid_s=60.0)
RESULT = JobResult(robot="r1", job=1, tag="a", outcome="expired", read=None)


@pytest.fixture
def opened(endpoint: str) -> Iterator[Callable[[], Uplink]]:
    """`opened()`: an uplink to the test's router."""
    with ExitStack() as stack:

        def open_() -> Uplink:
            uplink = Uplink(Route([endpoint], None), KEYS, "r1", senses=True)
            stack.callback(uplink.close)
            uplink.start()
            return uplink

        yield open_


@pytest.fixture
def link(router: object, endpoint: str) -> Iterator[Link]:
    """Of the service."""
    assert router is not None
    with Link.open([endpoint], wait_s=20.0) as link:
        yield link


def test_what_a_robot_wants_of_a_service(
    link: Link, opened: Callable[[], Uplink], eventually: Eventually
) -> None:
    asked: list[LeaseRequest] = []
    answers = {
        KEYS.map_version(): encode(VERSION),
        KEYS.map_tags(): msgspec.msgpack.encode([TAG]),
        KEYS.jobs("r1"): encode(JOB),
    }
    for key, answer in answers.items():
        link.serve(key, lambda query, answer=answer: query.reply(query.key, answer))

    def lease(query) -> None:  # type: ignore[no-untyped-def]
        asked.append(decode(LeaseRequest, query.payload))
        query.reply(query.key, encode(LeaseReply(lease=9, valid_s=1.0, retry_s=0.0)))

    link.serve(KEYS.lease(), lease)
    heard: list[bytes] = []
    link.subscribe(KEYS.job_results("r1"), lambda _, payload: heard.append(payload))
    uplink = opened()
    eventually(uplink.connected)
    eventually(lambda: uplink.lease(ASK, 1.0))
    assert asked[-1] == ASK
    served = []
    eventually(lambda: served or served.extend(filter(None, [uplink.served()])))
    assert (served[0].version, served[0].tags) == (VERSION, (TAG,))
    [job] = uplink.jobs()
    assert (job.job, job.tag) == (1, "a")
    assert 0.0 < job.valid_s <= 60.0

    def put() -> None:
        link.put(KEYS.jobs("r1"), b"\xc1")
        link.put(KEYS.jobs("r1"), encode(JOB))

    eventually(lambda: put() or uplink.jobs())
    assert uplink.malformed
    threads = [threading.Thread(target=uplink.publish_result, args=(RESULT,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    eventually(lambda: len(heard) == 4)
    assert {decode(JobResult, payload).outcome for payload in heard} == {"expired"}


def test_who_gets_no_answer_or_a_refusal_has_no_lease(
    link: Link, opened: Callable[[], Uplink], eventually: Eventually
) -> None:
    uplink = opened()
    assert uplink.lease(ASK, 0.1) is None, "there is no link yet, or nobody who answers"
    eventually(uplink.connected)
    assert uplink.lease(ASK, 0.1) is None
    replies = iter(["not now", b"\xc1"])

    def answer(query) -> None:  # type: ignore[no-untyped-def]
        what = next(replies)
        query.reply_error(what) if isinstance(what, str) else query.reply(query.key, what)

    link.serve(KEYS.lease(), answer)
    assert uplink.lease(ASK, 1.0) is None
    assert uplink.lease(ASK, 1.0) is None
    assert uplink.served() is None
    assert uplink.jobs() == []


def test_one_that_was_never_started_is_closed(endpoint: str) -> None:
    uplink = Uplink(Route([endpoint], None), KEYS, "r1", senses=True)
    uplink.publish_result(RESULT)
    uplink.close()
    assert uplink.lease(ASK, 0.1) is None


def test_one_without_a_router_is_closed_at_once(
    opened: Callable[[], Uplink], eventually: Eventually
) -> None:
    uplink = opened()
    eventually(lambda: uplink.trouble)
    uplink.close()
    assert not uplink._thread.is_alive()
