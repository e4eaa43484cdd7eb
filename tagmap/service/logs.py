"""Logs go to stderr: readable on a terminal, JSON lines otherwise. One event per decision."""

import sys
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TextIO, cast

import structlog

WINDOW_S = 10.0
BURST = 20


class Stderr:
    """A log that cannot be written (disk full, reader gone) is no reason to stop working."""

    def write(self, text: str) -> None:
        with suppress(OSError, ValueError):
            sys.stderr.write(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            sys.stderr.flush()


def configure() -> None:
    on_terminal = sys.stderr.isatty()
    renderer: Any = (
        structlog.dev.ConsoleRenderer() if on_terminal else structlog.processors.JSONRenderer()
    )
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            renderer,
        ],
        logger_factory=structlog.PrintLoggerFactory(cast(TextIO, Stderr())),
    )


@dataclass(slots=True)
class Throttle:
    """Lets `BURST` events of a name pass in `WINDOW_S`; counts the others."""

    until_s: float = 0.0
    seen: Counter[str] = field(default_factory=Counter)

    def allows(self, name: str) -> bool:
        self.seen[name] += 1
        return self.seen[name] <= BURST

    def turn(self, now_s: float) -> dict[str, int]:
        """At the end of a window: how many events of each name were held back in it."""
        if now_s < self.until_s:
            return {}
        held = {name: count - BURST for name, count in self.seen.items() if count > BURST}
        self.seen.clear()
        self.until_s = now_s + WINDOW_S
        return held
