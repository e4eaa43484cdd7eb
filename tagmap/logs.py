"""Where shells log to: stderr, for people on a terminal, one JSON object a line otherwise."""

import sys
from typing import TextIO

import structlog


def log_to(stream: TextIO | None = None) -> None:
    """Call once, at the start of a process; standard error by default."""
    stream = sys.stderr if stream is None else stream
    renderer: structlog.typing.Processor
    if stream.isatty():
        renderer = structlog.dev.ConsoleRenderer()
    else:
        renderer = structlog.processors.JSONRenderer()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            renderer,
        ],
        logger_factory=structlog.PrintLoggerFactory(stream),
        cache_logger_on_first_use=True,
    )
