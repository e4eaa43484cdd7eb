"""What a unit answers, taken from the bytes of a line that may be disturbed.

With echo on, a unit repeats each command before its answer: `PP * 22`, `PP9999 ! Maximum ...`
(manual 4.5.3). The protocol has no checksum and numbers nothing, so the echo is all that tells
which question an answer belongs to, and that a command arrived as it was sent.
"""

import re

LONGEST_BYTES = 1024
"""No answer is longer: what is, is noise."""

# `!P` and `!T` come by themselves when an axis meets a limit (manual 4.3.5); refusals have a blank.
_FINAL = re.compile(rb"(\*|! )([^\r\n]*)[\r\n]")
_LIMIT_HIT = re.compile(rb"![PT](?![A-Za-z])")
_NUMBER = re.compile(r"[-+]?\d{1,9}(?:\.\d{1,9})?")


class Garbled(Exception):
    """The bytes are no answer to what was asked. Asking again may help."""


class Refused(Exception):
    """The unit understood the command and will not."""


def is_complete(received: bytes) -> bool:
    """Whether an answer has come to its end; else more may follow."""
    return _FINAL.search(received) is not None or len(received) > LONGEST_BYTES


def answer(received: bytes, command: str, echo: bool | None) -> str:
    """The text behind `*`. echo: whether one has to be there; None: it may.

    Raises Garbled and Refused.
    """
    found = _FINAL.search(received)
    if found is None:
        raise Garbled(f"{command} was answered {_shown(received)}")
    before = _LIMIT_HIT.sub(b"", received[: found.start()]).split()
    repeated = " ".join(word.decode("latin-1").upper() for word in before)
    if repeated != (command if echo else "") and not (echo is None and repeated in (command, "")):
        raise Garbled(f"{command} was answered {_shown(received)}")
    text = found[2].decode("latin-1").strip()
    if found[1] != b"*":
        raise Refused(f"{command}: {text}")
    return text


def number(text: str, command: str) -> float:
    """The number of a terse answer. Raises Garbled for words: a unit that lost its power answers
    in sentences again."""
    if not _NUMBER.fullmatch(text):
        shown = _shown(text.encode("latin-1"))
        raise Garbled(f"{command} was answered {shown}, expected a number: was the unit restarted?")
    return float(text)


def _shown(received: bytes) -> str:
    return repr(received[:60])[1:]
