"""What one step of the mapper wants committed and said."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from tagmap.records import Hello, Keyframe


@dataclass(frozen=True, slots=True)
class Arrival:
    """A message on `agents/<robot>/keyframes`; `robot` is the key's."""

    robot: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class Refused:
    """A settled message that will never be stored."""

    robot: str
    session: str
    seq: int
    reason: str


@dataclass(frozen=True, slots=True)
class Event:
    """One decision, for the log."""

    name: str
    fields: dict[str, Any]


@dataclass(slots=True)
class Draft:
    """Collected while arrivals are judged.

    refused  by (robot, session, seq): the last verdict on a message counts
    touched  seqs by (robot, session), in order
    """

    hellos: list[Hello] = field(default_factory=list)
    keyframes: list[Keyframe] = field(default_factory=list)
    refused: dict[tuple[str, str, int], Refused] = field(default_factory=dict)
    touched: dict[tuple[str, str], list[int]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)

    def accept(self, message: Hello | Keyframe) -> None:
        if isinstance(message, Hello):
            self.hellos.append(message)
        else:
            self.keyframes.append(message)
        self.refused.pop((message.robot, message.session, message.seq), None)
        self.touch(message.robot, message.session, [message.seq])

    def refuse(self, refused: Refused) -> None:
        self.refused[refused.robot, refused.session, refused.seq] = refused

    def touch(self, robot: str, session: str, seqs: Iterable[int]) -> None:
        self.touched.setdefault((robot, session), []).extend(seqs)

    def note(self, name: str, **fields: Any) -> None:
        self.events.append(Event(name, fields))
