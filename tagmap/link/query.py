"""A question asked over the link, and what came back."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Reply:
    """One answer to a get: a key with its payload, or an error text."""

    key: str
    payload: bytes | None
    error: str | None


class Asker(Protocol):
    """Who waits for the answer: each of these ends the question, and lets its asker go."""

    def answer(self, answers: Iterable[tuple[str, bytes]]) -> bool: ...

    def refuse(self, text: str) -> bool: ...

    def leave(self) -> None:
        """Without a word."""
        ...


@dataclass(frozen=True, slots=True)
class Query:
    """A question that arrived. Exactly one of the methods ends it: an unended query keeps the
    asker waiting for its timeout. May be answered from any thread."""

    key: str
    parameters: dict[str, str]
    payload: bytes
    _asker: Asker = field(repr=False, compare=False)

    def reply(self, key: str, payload: bytes) -> bool:
        """False when it could not be sent: the asker's key does not cover `key`, or it is gone."""
        return self.reply_many([(key, payload)])

    def reply_many(self, answers: Iterable[tuple[str, bytes]]) -> bool:
        """Any number of keys and payloads, then the end."""
        return self._asker.answer(answers)

    def reply_error(self, text: str) -> bool:
        return self._asker.refuse(text)

    def drop(self) -> None:
        """End it without an answer; the asker sees nobody there."""
        self._asker.leave()


def parameters_of(text: str) -> dict[str, str]:
    """`a=1;b` as {"a": "1", "b": ""}; of a name given twice the last counts."""
    pairs = (part.partition("=") for part in text.split(";") if part)
    return {name: value for name, _, value in pairs}
