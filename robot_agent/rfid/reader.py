"""What the agent asks of an RFID reader, and every way in which that ends.

Nothing here raises for what happens on the air or on the line: the answer is a result or a
`Failure`, for a tag that stays silent is the everyday case, not an exception.
"""

from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

Reason: TypeAlias = Literal[
    "nothing_heard",
    "other_tags_only",
    "no_answer",
    "locked",
    "overrun",
    "no_power",
    "partial",
    "tag_error",
    "reader_error",
    "reader_gone",
    "bad_request",
]
"""nothing_heard    no tag answered within the time
other_tags_only  tags answered, but not the one that was asked for
no_answer        the tag was heard, then did not answer the command
locked           the tag's memory is locked
overrun          the tag's memory is shorter than that
no_power         the tag hears the reader but lacks the power to write
partial          some words were written and some not, or read back otherwise than written
tag_error        the tag refused and did not say why
reader_error     the reader refused, or its answer made no sense
reader_gone      no connection, or it was lost on the way; what was asked for may have been done
bad_request      what was asked is no EPC, address or word; nothing was sent
"""


@dataclass(frozen=True, slots=True)
class Failure:
    """detail: one line for people. words_written: how many the tag acknowledged before it failed;
    None: unknown. After any failed write the memory holds old, new and possibly broken words."""

    reason: Reason
    detail: str
    words_written: int | None = None


@dataclass(frozen=True, slots=True)
class Heard:
    """One EPC of an inventory, lower-case hex, and how often it answered. first_s, last_s: after
    the window began, by the reader's clock; None where the reader does not say."""

    epc: str
    count: int
    first_s: float | None = None
    last_s: float | None = None


@dataclass(frozen=True, slots=True)
class Inventory:
    """All that answered while the window was open; `tags` in order of EPC. By this machine's
    clock the window lies within started_ns and ended_ns."""

    tags: tuple[Heard, ...]
    started_ns: int
    ended_ns: int


@dataclass(frozen=True, slots=True)
class UserWords:
    """Words of 16 bits read from user memory, the first of them at address `start`."""

    epc: str
    start: int
    words: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ReaderInfo:
    """What a reader says about itself. Numbers as its maker assigns them."""

    address: str
    manufacturer: int
    model: int
    firmware: str
    antennas: int


class RfidReader(Protocol):
    """A reader of tags. Calls block no longer than the times they are given and a second or two
    for the line; they may come from any thread and wait for each other.

    EPCs are hex, in either case. Whoever needs a value on the tag to be certain writes it with
    `write_user`, which reads it back in the same breath.
    """

    def probe(self) -> ReaderInfo | Failure:
        """Connect if need be and ask the reader what it is."""

    def inventory(self, window_s: float) -> Inventory | Failure:
        """Listen for `window_s` from now on. Nobody heard is an empty inventory, not a failure."""

    def read_user(
        self, epc: str, start: int, count: int | None, timeout_s: float
    ) -> UserWords | Failure:
        """`count` words of user memory from `start`; None: all up to its end."""

    def write_user(
        self, epc: str, start: int, words: tuple[int, ...], timeout_s: float
    ) -> UserWords | Failure:
        """Write, read back, compare; the result is what was read back."""

    def close(self) -> None:
        """Let go of the reader. The next call connects again."""
