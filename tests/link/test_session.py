"""What a link does while its router is there."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import TypeAlias

import pytest

from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.query import Query
from tagmap.link.router import RouterProcess
from tagmap.link.session import Link
from tagmap.records.codec import MAX_BYTES

Connect: TypeAlias = Callable[[], Link]
Eventually: TypeAlias = Callable[[Callable[[], object]], None]
KEYS = Keys("site")


def test_puts_arrive_in_order(connect: Connect, eventually: Eventually) -> None:
    heard: list[tuple[str, bytes]] = []
    service, agent = connect(), connect()
    service.subscribe(KEYS.keyframes(), lambda *sample: heard.append(sample))
    agent_ready(service, agent, heard, eventually)
    sent = [(KEYS.keyframes("r1"), b"%d" % number) for number in range(200)]
    for sample in sent:
        agent.put(*sample)
    eventually(lambda: heard == sent)


def agent_ready(
    service: Link, agent: Link, heard: list[tuple[str, bytes]], eventually: Eventually
) -> None:
    """Return when a first put has come through, and forget it."""

    def heard_something() -> bool:
        agent.put(KEYS.keyframes("r1"), b"")
        return bool(heard)

    eventually(heard_something)
    service.serve("barrier", lambda query: query.reply("barrier", b""))
    agent.ask("barrier")
    eventually(lambda: not heard or heard.clear())


def test_questions_carry_parameters_and_payload(connect: Connect) -> None:
    asked: list[Query] = []

    def answer(query: Query) -> None:
        asked.append(query)
        query.reply(query.key, b"pose")

    connect().serve(KEYS.pose(), answer)
    asker = connect()
    (reply,) = asker.ask(KEYS.pose("r1") + "?t_ns=12;state=good;flag", b"question")
    assert (reply.key, reply.payload, reply.error) == (KEYS.pose("r1"), b"pose", None)
    assert asked[-1].key == KEYS.pose("r1")
    assert asked[-1].parameters == {"t_ns": "12", "state": "good", "flag": ""}
    assert asked[-1].payload == b"question"


def test_one_question_many_answers(connect: Connect) -> None:
    tags = {KEYS.map_tag(f"t{number}"): b"%d" % number for number in range(1000)}
    connect().serve(KEYS.map_tag(), lambda query: query.reply_many(tags.items()))
    replies = connect().ask(KEYS.map_tag())
    assert {reply.key: reply.payload for reply in replies} == tags


def test_an_error_is_an_answer(connect: Connect) -> None:
    connect().serve(KEYS.localize(), lambda query: query.reply_error("no tags: seen 0 of 3"))
    (reply,) = connect().ask(KEYS.localize())
    assert (reply.payload, reply.error) == (None, "no tags: seen 0 of 3")


def test_dropped_questions_do_not_keep_the_asker_waiting(connect: Connect) -> None:
    connect().serve(KEYS.localize(), lambda query: query.drop())
    started = time.monotonic()
    assert connect().get(KEYS.localize(), timeout_s=60.0) == []
    assert time.monotonic() - started < 30.0


def test_answers_that_cannot_be_sent_are_reported(connect: Connect) -> None:
    sent: list[bool] = []

    def answer(query: Query) -> None:
        sent.append(query.reply("elsewhere", b""))
        sent.append(query.reply(query.key, b"too late"))
        sent.append(query.reply_error("too late"))

    connect().serve(KEYS.localize(), answer)
    with pytest.raises(LinkError, match="no answer to tagmap/site/localize within 1 s"):
        connect().ask(KEYS.localize(), timeout_s=1.0)
    assert sent
    assert not any(sent)


def test_nobody_to_ask_is_not_nothing_to_say(connect: Connect) -> None:
    link = connect()
    assert link.get(KEYS.map_tags()) == []
    with pytest.raises(LinkError, match="no answer to tagmap/site/map/tags within"):
        link.ask(KEYS.map_tags(), timeout_s=0.5)


def test_who_is_alive(connect: Connect, eventually: Eventually) -> None:
    changes: list[tuple[str, bool]] = []
    service, early, late, visitor = (connect() for _ in range(4))
    early.declare_alive(KEYS.alive("r1"))
    service.watch_alive(KEYS.alive(), lambda *change: changes.append(change))
    late.declare_alive(KEYS.alive("r2"))
    eventually(lambda: len(changes) == 2)
    assert sorted(changes) == [(KEYS.alive("r1"), True), (KEYS.alive("r2"), True)]
    eventually(lambda: visitor.alive(KEYS.alive()) == [KEYS.alive("r1"), KEYS.alive("r2")])
    early.close()
    eventually(lambda: changes[2:] == [(KEYS.alive("r1"), False)])


def test_larger_than_any_record_stops_at_the_router(
    connect: Connect, eventually: Eventually
) -> None:
    heard: list[tuple[str, bytes]] = []
    service, agent = connect(), connect()
    service.subscribe(KEYS.keyframes(), lambda *sample: heard.append(sample))
    agent_ready(service, agent, heard, eventually)
    for size in (MAX_BYTES + 1, 4_000_000, 20_000_000, MAX_BYTES):
        agent.put(KEYS.keyframes("r1"), bytes(size))
    eventually(lambda: heard)
    assert [len(payload) for _, payload in heard] == [MAX_BYTES]
    assert agent.connected()


def test_a_failing_handler_is_called_again(connect: Connect, eventually: Eventually) -> None:
    heard: list[bytes] = []

    def fail(_key: str, payload: bytes) -> None:
        heard.append(payload)
        raise ValueError("not the link's fault")

    service, agent = connect(), connect()
    service.subscribe(KEYS.keyframes(), fail)

    def heard_twice() -> bool:
        agent.put(KEYS.keyframes("r1"), b"")
        return len(heard) >= 2

    eventually(heard_twice)


def test_a_slow_subscriber_keeps_nobody_else_waiting(
    connect: Connect, eventually: Eventually
) -> None:
    """Neither the other declarations of its own link nor the other links."""
    stuck, done = threading.Event(), threading.Event()
    own: list[tuple[str, bytes]] = []
    other: list[tuple[str, bytes]] = []

    def block(_key: str, _payload: bytes) -> None:
        stuck.set()
        done.wait()

    slow, bystander, agent = connect(), connect(), connect()
    slow.subscribe(KEYS.keyframes(), block, capacity=4)
    slow.subscribe(KEYS.agent_pose(), lambda *sample: own.append(sample))
    slow.serve(KEYS.ack(), lambda query: query.reply(query.key, b"ack"))
    bystander.subscribe(KEYS.keyframes(), lambda *sample: other.append(sample), capacity=8192)
    agent_ready(bystander, agent, other, eventually)
    try:
        eventually(stuck.is_set)
        for _ in range(4000):  # 4 MB: far more than all queues on the way hold
            agent.put(KEYS.keyframes("r1"), bytes(1000))
        agent.put(KEYS.agent_pose("r1"), b"pose")
        eventually(lambda: own)
        assert agent.ask(KEYS.ack("r1"))[0].payload == b"ack"
        eventually(lambda: len(other) > 2000)
    finally:
        done.set()


def test_a_bad_key_is_our_error(connect: Connect) -> None:
    link = connect()
    for speak in (link.get, link.declare_alive, link.alive, lambda key: link.put(key, b"")):
        with pytest.raises(LinkError, match="a//b"):
            speak("a//b")


def test_a_closed_link_calls_nothing_and_says_so(connect: Connect) -> None:
    before = set(threading.enumerate())
    link = connect()
    link.subscribe(KEYS.keyframes(), lambda *_: None)
    link.serve(KEYS.ack(), lambda query: query.drop())
    link.watch_alive(KEYS.alive(), lambda *_: None)
    link.on_connected(lambda: None)
    link.declare_alive(KEYS.alive("r1"))
    link.close()
    link.close()
    assert {thread for thread in set(threading.enumerate()) - before if thread.is_alive()} == set()
    assert not link.connected()
    with pytest.raises(LinkError, match="closed"):
        link.put(KEYS.keyframes("r1"), b"")
    with pytest.raises(LinkError, match="closed"):
        link.get(KEYS.localize())


@pytest.mark.parametrize("ending", ["link.close()", "pass", "1 / 0"])
def test_the_process_exits(router: RouterProcess, endpoint: str, ending: str) -> None:
    assert router.poll() is None
    program = f"""
from tagmap.link.session import Link
link = Link.open(["{endpoint}"], wait_s=10.0)
link.subscribe("a/**", print)
link.serve("a/**", print)
link.watch_alive("a/**", print)
link.on_connected(lambda: None)
link.declare_alive("a/alive")
{ending}
"""
    done = subprocess.run([sys.executable, "-c", program], timeout=60, capture_output=True)
    assert done.returncode == (1 if "/" in ending else 0)
