"""Ctrl-C and SIGTERM end a command in order: what it started is stopped first."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import click

INTERRUPTED = 130


@contextmanager
def interruptible() -> Iterator[None]:
    """The first signal unwinds what is inside, later ones are not heard; then exit 130."""

    def unwind(_number: int, _frame: FrameType | None) -> None:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, unwind)
    try:
        yield
    except KeyboardInterrupt:
        click.echo("fleet: interrupted, everything is stopped", err=True)
        sys.exit(INTERRUPTED)
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def ending_early() -> Iterator[Callable[[], bool]]:
    """Ctrl-C once: whether it was pressed, so that there is a result. Twice: as `interruptible`."""
    pressed: list[int] = []

    def press(number: int, _frame: FrameType | None) -> None:
        if pressed:
            raise KeyboardInterrupt
        pressed.append(number)
        click.echo("ending early; once more to give up", err=True)

    with interruptible():
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, press)
        yield lambda: bool(pressed)
