"""Every allow and every deny of the generated rules, with real sessions through a real router.

That something does not arrive is shown by what was sent after it and did: see `Parties.settle`.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest
import zenoh

from tagmap.link.config import client_config
from tagmap.link.keys import Keys
from tagmap.link.query import Query
from tagmap.link.session import Link

if TYPE_CHECKING:
    from tests.deploy.conftest import SecuredSite

KEYS = Keys("hall")
MARKER = b"marker"
ROUTER = "@/*/router/**"


@dataclass
class Parties:
    """Everybody of a site connected, the service answering whatever it may be asked."""

    service: Link
    admin: Link
    r1: Link
    r2: Link
    heard: dict[str, list[tuple[str, bytes]]]
    eventually: Callable[[Callable[[], object]], None]

    def hear(self, name: str, *key_exprs: str) -> None:
        log = self.heard.setdefault(name, [])
        for key_expr in key_exprs:
            getattr(self, name).subscribe(key_expr, lambda *sample: log.append(sample))

    def hear_everything_allowed(self) -> None:
        self.hear("service", f"{KEYS.root}/agents/**")
        self.hear("admin", f"{KEYS.root}/**")
        for robot in ("r1", "r2"):
            self.hear(robot, f"{KEYS.robots(robot)}/**", f"{KEYS.root}/map/**")
        self.settle()
        for log in self.heard.values():
            log.clear()

    def watch(self, name: str) -> list[tuple[str, bool]]:
        """What `name` sees of the living, from now on; admin looks at the whole site."""
        seen: list[tuple[str, bool]] = []
        key_expr = f"{KEYS.root}/**" if name == "admin" else KEYS.alive()
        getattr(self, name).watch_alive(key_expr, lambda *change: seen.append(change))
        return seen

    def settle(self) -> None:
        """Return when the router has dealt with all that was sent, and all of it was heard.

        An answered question, or a heard put, shows that the router is done with what its sender
        sent before; a put that is sent then comes to every listener after all of that.
        """
        self.r1.ask(KEYS.ack("r1"))
        self.r2.ask(KEYS.ack("r2"))
        self.admin.ask(KEYS.admin("db", "check"))
        for _ in range(2):
            self._mark(self.service, KEYS.ack("r1"), "r1")
            self._mark(self.service, KEYS.ack("r2"), "r2")
            self._mark(self.r1, KEYS.keyframes("r1"), "service")
            self._mark(self.r1, KEYS.keyframes("r1"), "admin")

    def _mark(self, writer: Link, key: str, listener: str) -> None:
        if listener not in self.heard:
            return
        log = self.heard[listener]
        before = log.count((key, MARKER))

        def heard() -> bool:
            writer.put(key, MARKER)
            return log.count((key, MARKER)) > before

        self.eventually(heard)

    def unmarked(self, name: str) -> list[str]:
        return [key for key, payload in self.heard[name] if payload != MARKER]


@pytest.fixture
def parties(secured: "SecuredSite", eventually: Any) -> Iterator[Parties]:
    with ExitStack() as stack:
        names = ("service", "admin", "robots/r1", "robots/r2")
        links = [stack.enter_context(secured.open(name)) for name in names]
        _serve_everything(links[0])
        yield Parties(*links, heard={}, eventually=eventually)


def _serve_everything(service: Link) -> None:
    def answer(query: Query) -> None:
        query.reply(query.key, b"service")

    for key_expr in (
        KEYS.ack(),
        KEYS.pose(),
        KEYS.jobs(),
        KEYS.map_tags(),
        KEYS.map_tag(),
        KEYS.localize(),
        KEYS.lease(),
        KEYS.admin(),
    ):
        service.serve(key_expr, answer)


FROM_R1 = [KEYS.keyframes("r1"), KEYS.agent_pose("r1"), KEYS.job_results("r1")]
TO_R1 = [KEYS.ack("r1"), KEYS.pose("r1"), KEYS.jobs("r1")]
TO_R2 = [KEYS.ack("r2"), KEYS.pose("r2"), KEYS.jobs("r2")]
TO_ALL = [KEYS.map_tag("t1"), KEYS.map_version()]


def test_agent_is_heard_by_service_and_admin(parties: Parties) -> None:
    parties.hear_everything_allowed()
    for key in FROM_R1:
        parties.r1.put(key, b"data")
    parties.settle()
    assert parties.unmarked("service") == FROM_R1
    assert parties.unmarked("admin") == FROM_R1
    assert parties.unmarked("r2") == []


def test_service_is_heard_by_those_it_addresses(parties: Parties) -> None:
    parties.hear_everything_allowed()
    for key in TO_R1 + TO_R2 + TO_ALL:
        parties.service.put(key, b"data")
    parties.settle()
    assert sorted(parties.unmarked("r1")) == sorted(TO_R1 + TO_ALL)
    assert sorted(parties.unmarked("r2")) == sorted(TO_R2 + TO_ALL)
    assert parties.unmarked("admin") == TO_R1 + TO_R2 + TO_ALL


ELSEWHERE = [KEYS.localize(), KEYS.lease(), KEYS.admin("map", "solve"), f"{KEYS.root}/other"]
FROM_R2 = [KEYS.keyframes("r2"), KEYS.agent_pose("r2"), KEYS.job_results("r2"), KEYS.alive("r2")]


@pytest.mark.parametrize(
    ("writer", "denied"),
    [
        ("r1", FROM_R2 + TO_R1 + TO_R2 + TO_ALL + ELSEWHERE),
        ("service", [*FROM_R1, *FROM_R2, f"{KEYS.root}/other"]),
        ("admin", FROM_R1 + FROM_R2 + TO_R1 + TO_R2 + TO_ALL + ELSEWHERE),
    ],
)
def test_nobody_hears_a_put_outside_the_writers_keys(
    parties: Parties, writer: str, denied: list[str]
) -> None:
    parties.hear_everything_allowed()
    for key in denied:
        getattr(parties, writer).put(key, b"data")
    parties.settle()
    for listener in {"service", "admin", "r1", "r2"} - {writer}:
        assert parties.unmarked(listener) == [], listener


def test_agent_hears_nothing_that_is_not_for_it(parties: Parties) -> None:
    others = (KEYS.agents("r2"), KEYS.robots("r2"), f"{KEYS.root}/admin", f"{KEYS.root}/agents")
    parties.hear("r1", *(f"{prefix}/**" for prefix in others), KEYS.ack(), KEYS.pose())
    parties.hear("r1", f"{KEYS.root}/**", "**", KEYS.keyframes())
    parties.hear_everything_allowed()
    for key in FROM_R2:
        parties.r2.put(key, b"data")
    for key in TO_R2:
        parties.service.put(key, b"data")
    parties.settle()
    assert parties.unmarked("r1") == []


@pytest.mark.parametrize(
    ("asker", "keys"),
    [
        ("r1", [*TO_R1, KEYS.map_tags(), KEYS.map_tag("t1"), KEYS.localize(), KEYS.lease()]),
        ("admin", [*TO_R1, *TO_R2, KEYS.map_tags(), KEYS.map_tag("t1"), KEYS.localize()]),
        ("admin", [KEYS.admin("tags", "survey"), KEYS.admin("map", "solve")]),
    ],
)
def test_questions_that_are_answered(parties: Parties, asker: str, keys: list[str]) -> None:
    for key in keys:
        (reply,) = getattr(parties, asker).ask(f"{key}?t_ns=1", b"question")
        assert (reply.key, reply.payload) == (key, b"service")


def test_admin_asks_about_all_robots_at_once(parties: Parties) -> None:
    (reply,) = parties.admin.ask(KEYS.ack())
    assert reply.payload == b"service"


@pytest.mark.parametrize(
    ("asker", "keys"),
    [
        ("r1", [*TO_R2, KEYS.ack(), KEYS.admin("tags", "survey"), KEYS.admin(), ROUTER, "**"]),
        ("admin", [KEYS.lease(), ROUTER]),
        ("service", [ROUTER]),
    ],
)
def test_questions_that_nobody_gets(parties: Parties, asker: str, keys: list[str]) -> None:
    parties.settle()
    for key in keys:
        assert getattr(parties, asker).get(key) == [], key


@pytest.mark.parametrize("impostor", ["r1", "admin"])
def test_only_the_service_answers(parties: Parties, impostor: str) -> None:
    def lie(query: Query) -> None:
        query.reply(query.key, b"impostor")

    for key in (KEYS.ack(), KEYS.ack("r2"), KEYS.map_tags(), KEYS.localize(), KEYS.admin()):
        getattr(parties, impostor).serve(key, lie)
    parties.settle()
    for key in (KEYS.ack("r2"), KEYS.map_tags(), KEYS.localize()):
        assert [reply.payload for reply in parties.r2.ask(key)] == [b"service"]
    if impostor != "admin":
        answers = parties.admin.ask(KEYS.admin("tags", "list"))
        assert [reply.payload for reply in answers] == [b"service"]


def test_service_and_admin_see_who_is_alive(parties: Parties) -> None:
    seen = parties.watch("service")
    parties.r1.declare_alive(KEYS.alive("r1"))
    parties.eventually(lambda: seen == [(KEYS.alive("r1"), True)])
    parties.eventually(lambda: parties.admin.alive(KEYS.alive()) == [KEYS.alive("r1")])
    parties.r1.close()
    parties.eventually(lambda: seen[1:] == [(KEYS.alive("r1"), False)])


@pytest.mark.parametrize("impostor", ["r1", "service", "admin"])
def test_nobody_is_alive_in_anothers_name(parties: Parties, impostor: str) -> None:
    witnesses = {"service", "admin"} - {impostor}  # everybody sees the own tokens
    seen = [parties.watch(witness) for witness in witnesses]
    for key in (KEYS.alive("r2"), f"{KEYS.robots('r2')}/alive", f"{KEYS.root}/alive"):
        getattr(parties, impostor).declare_alive(key)
    parties.settle()
    parties.r1.declare_alive(KEYS.alive("r1"))
    parties.eventually(lambda: all(seen))
    assert all(changes == [(KEYS.alive("r1"), True)] for changes in seen)


def test_agent_does_not_see_who_is_alive(parties: Parties) -> None:
    shown, hidden = parties.watch("service"), parties.watch("r1")
    parties.r1.watch_alive(KEYS.alive("r2"), lambda *change: hidden.append(change))
    parties.r2.declare_alive(KEYS.alive("r2"))
    parties.eventually(lambda: shown == [(KEYS.alive("r2"), True)])
    parties.settle()
    assert hidden == []
    assert parties.r1.alive(KEYS.alive("r2")) == []


def test_agents_that_declare_publishers_are_told_that_the_service_listens(
    parties: Parties, secured: "SecuredSite"
) -> None:
    """Zenoh drops what a declared publisher puts while it knows of no listener."""
    parties.hear_everything_allowed()
    with zenoh.open(client_config([], secured.config("robots/r1"))) as session:
        publisher = session.declare_publisher(KEYS.keyframes("r1"))
        parties.eventually(lambda: publisher.matching_status.matching)
        publisher.put(b"data")
        parties.eventually(lambda: KEYS.keyframes("r1") in parties.unmarked("service"))
