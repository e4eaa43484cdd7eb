"""A question asked over the link, and what came back."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import zenoh

ENCODING = zenoh.Encoding("application/msgpack")


@dataclass(frozen=True, slots=True)
class Reply:
    """One answer to a get: a key with its payload, or an error text."""

    key: str
    payload: bytes | None
    error: str | None


@dataclass(frozen=True, slots=True)
class Query:
    """A question that arrived. Exactly one of the methods ends it: an unended query keeps the
    asker waiting for its timeout. May be answered from any thread."""

    key: str
    parameters: dict[str, str]
    payload: bytes
    _query: zenoh.Query = field(repr=False, compare=False)

    def reply(self, key: str, payload: bytes) -> bool:
        """False when it could not be sent: the asker's key does not cover `key`, or it is gone."""
        return self.reply_many([(key, payload)])

    def reply_many(self, answers: Iterable[tuple[str, bytes]]) -> bool:
        """Any number of keys and payloads, then the end."""
        try:
            with self._query as query:
                for key, payload in answers:
                    query.reply(key, payload, encoding=ENCODING)
        except zenoh.ZError:
            return False
        return True

    def reply_error(self, text: str) -> bool:
        try:
            with self._query as query:
                query.reply_err(text.encode(), encoding=zenoh.Encoding.TEXT_PLAIN)
        except zenoh.ZError:
            return False
        return True

    def drop(self) -> None:
        """End it without an answer; the asker sees nobody there."""
        self._query.drop()  # type: ignore[no-untyped-call]


def query_from(query: zenoh.Query) -> Query:
    payload = b"" if query.payload is None else query.payload.to_bytes()
    return Query(str(query.key_expr), _parameters(str(query.parameters)), payload, query)


def _parameters(text: str) -> dict[str, str]:
    """`a=1;b` as {"a": "1", "b": ""}; of a name given twice the last counts."""
    pairs = (part.partition("=") for part in text.split(";") if part)
    return {name: value for name, _, value in pairs}


def reply_from(reply: zenoh.Reply) -> Reply:
    if (sample := reply.ok) is not None:
        return Reply(str(sample.key_expr), sample.payload.to_bytes(), None)
    error = reply.err
    text = error.payload.to_bytes().decode(errors="replace") if error else ""
    return Reply("", None, text)
