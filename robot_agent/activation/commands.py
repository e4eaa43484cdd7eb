"""What a shot asks for, and what it is told: the devices are beyond this page."""

from collections.abc import Generator
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

from robot_agent.laser.device import Steps
from robot_agent.laser.interlock import Mark, Permit
from robot_agent.rfid.reader import Failure, Inventory, UserWords
from tagmap.records.lease import LeaseReply


@dataclass(frozen=True, slots=True)
class Aim:
    """Turn the mirrors, in the dark."""

    steps: Steps


@dataclass(frozen=True, slots=True)
class Light:
    """Laser on for so long from now, or on for that much longer."""

    for_s: float


@dataclass(frozen=True, slots=True)
class Dark:
    """Laser off."""


@dataclass(frozen=True, slots=True)
class Listen:
    window_s: float


@dataclass(frozen=True, slots=True)
class Read:
    """All user memory of a tag."""

    tag: str
    timeout_s: float


@dataclass(frozen=True, slots=True)
class Write:
    tag: str
    first_word: int
    words: tuple[int, ...]
    timeout_s: float


@dataclass(frozen=True, slots=True)
class Wait:
    """Let time pass until `until_ns`."""

    until_ns: int


@dataclass(frozen=True, slots=True)
class Rest:
    """Whether so much light in a row would be allowed by now; nothing is waited for."""

    for_s: float


@dataclass(frozen=True, slots=True)
class Ask:
    """The service for a lease of `wanted_s`; 0: give `done` back and want none."""

    wanted_s: float
    done: int | None
    timeout_s: float


@dataclass(frozen=True, slots=True)
class Allow:
    """What the interlock obeys from now on; None: no light. `since`: when it was asked for, None:
    now."""

    permit: Permit | None
    since: Mark | None = None


Command: TypeAlias = Aim | Light | Dark | Listen | Read | Write | Wait | Rest | Ask | Allow


@dataclass(frozen=True, slots=True)
class Denied:
    """The interlock's reason why the laser is dark."""

    why: str


@dataclass(frozen=True, slots=True)
class Answered:
    """To Ask: `mark` is from before it was asked. `reply` None: none came."""

    reply: LeaseReply | None
    mark: Mark


Value: TypeAlias = Denied | Answered | Inventory | UserWords | Failure | None


@dataclass(frozen=True, slots=True)
class Reply:
    """`value` is what the command came to; None: done. `now_ns` when that was."""

    value: Value
    now_ns: int


T = TypeVar("T")
Act: TypeAlias = Generator[Command, Reply, T]
"""A part of the state machine: yields commands, is sent what came of them, returns its result."""
