"""Zenoh's queries and replies, as ours."""

from collections.abc import Iterable
from dataclasses import dataclass

import zenoh

from tagmap.link.query import Query, Reply, parameters_of

ENCODING = zenoh.Encoding("application/msgpack")


@dataclass(frozen=True, slots=True)
class ZenohAsker:
    """Somebody who asked through a router."""

    _query: zenoh.Query

    def answer(self, answers: Iterable[tuple[str, bytes]]) -> bool:
        try:
            with self._query as query:
                for key, payload in answers:
                    query.reply(key, payload, encoding=ENCODING)
        except zenoh.ZError:
            return False
        return True

    def refuse(self, text: str) -> bool:
        try:
            with self._query as query:
                query.reply_err(text.encode(), encoding=zenoh.Encoding.TEXT_PLAIN)
        except zenoh.ZError:
            return False
        return True

    def leave(self) -> None:
        self._query.drop()  # type: ignore[no-untyped-call]


def query_from(query: zenoh.Query) -> Query:
    payload = b"" if query.payload is None else query.payload.to_bytes()
    parameters = parameters_of(str(query.parameters))
    return Query(str(query.key_expr), parameters, payload, ZenohAsker(query))


def reply_from(reply: zenoh.Reply) -> Reply:
    if (sample := reply.ok) is not None:
        return Reply(str(sample.key_expr), sample.payload.to_bytes(), None)
    error = reply.err
    text = error.payload.to_bytes().decode(errors="replace") if error else ""
    return Reply("", None, text)
