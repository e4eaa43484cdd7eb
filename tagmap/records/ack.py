"""What the service says about a session's keyframes, after they are committed."""

from typing import Annotated

from msgspec import Meta

from tagmap.records.base import Message, Record, Seq, SessionId


class Refusal(Record, frozen=True, kw_only=True):
    """A settled keyframe that will never be stored, and why."""

    seq: Seq
    reason: str


class Ack(Message, frozen=True, kw_only=True):
    """Everything up to and including `contiguous` is settled; -1: not even the hello.

    `refused` lists refusals among what this acknowledgement settles anew; a get answers with all
    of the session's refusals, newest first, at most 1000.
    """

    session: SessionId
    contiguous: Annotated[int, Meta(ge=-1)]
    refused: tuple[Refusal, ...] = ()
