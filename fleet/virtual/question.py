"""A question under way, and those who are to answer it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from fleet.virtual.matching import meets
from fleet.virtual.port import Port
from fleet.virtual.weather import Parts, Passage
from tagmap.link.query import Query, Reply, parameters_of

if TYPE_CHECKING:
    from fleet.virtual.bus import Bus


@dataclass(slots=True)
class Question:
    """open: how many of those who were asked have not answered yet."""

    bus: "Bus"
    asker: Port
    selector: str
    on_end: Callable[[list[Reply]], None]
    replies: list[Reply] = field(default_factory=list)
    open: int = 0
    is_over: bool = False

    def reach(self, message: Passage, ports: Iterable[Port]) -> None:
        """At the router: to everybody who serves it; nobody does: that is an answer, too."""
        key, _, parameters = self.selector.partition("?")
        for port in ports:
            for key_expr, on_query in port.served:
                if meets(key_expr, key):
                    self.open += 1
                    query = partial(Query, key, parameters_of(parameters))
                    answering = Answering(self, port)
                    self.bus.down(port, message, self.asker, _Asking(query, answering, on_query))
        if not self.open:
            takes_ns = self.bus.connection(self.asker.name).down.takes_ns()
            self.asker.at(message.t_ns + takes_ns, self.end)

    def take(self, replies: list[Reply]) -> None:
        self.replies += replies
        self.open -= 1
        if self.open == 0:
            self.end()

    def expire(self) -> None:
        if not self.is_over:
            self.replies.append(Reply("", None, "Timeout"))
            self.end()

    def end(self) -> None:
        if not self.is_over:
            self.is_over = True
            self.on_end(self.replies)


@dataclass(slots=True)
class Answering:
    """One of those who were asked; the first answer counts, whatever arrives twice."""

    question: Question
    port: Port
    has_answered: bool = False
    has_arrived: bool = False

    def answer(self, answers: Iterable[tuple[str, bytes]]) -> bool:
        asked = self.question.selector.partition("?")[0]
        fitting = [(key, payload) for key, payload in answers if meets(asked, key)]
        keys = [key for key, _ in fitting]
        return self._send(
            tuple(payload for _, payload in fitting),
            lambda parts: [Reply(k, p, None) for k, p in zip(keys, parts, strict=True)],
        )

    def refuse(self, text: str) -> bool:
        return self._send(
            (text.encode(),),
            lambda parts: [Reply("", None, parts[0].decode(errors="replace"))],
        )

    def leave(self) -> None:
        self._send((), lambda _: [])

    def _send(self, parts: Parts, replies: Callable[[Parts], list[Reply]]) -> bool:
        if self.has_answered or not self.port.is_open:
            return False
        self.has_answered = True

        def arrive(arrived: Parts) -> None:
            if not self.has_arrived:
                self.has_arrived = True
                self.question.take(replies(arrived))

        self.question.bus.travel(self.port, self.question.asker, parts, arrive)
        return True


@dataclass(frozen=True, slots=True)
class _Asking:
    """The question as it arrives at one of those who serve its key."""

    query: Callable[[bytes, Answering], Query]
    answering: Answering
    on_query: Callable[[Query], None]

    def __call__(self, parts: Parts) -> None:
        self.on_query(self.query(parts[0], self.answering))
