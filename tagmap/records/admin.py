"""What the command line asks of the service: `admin/<noun>/<verb>` with named arguments."""

from typing import Any

import msgspec

from tagmap.records.base import Message


class AdminRequest(Message, frozen=True, kw_only=True):
    args: dict[str, Any] = msgspec.field(default_factory=dict)


class AdminReply(Message, frozen=True, kw_only=True):
    """`error` is null when it was done; `data` is then what the command prints as JSON."""

    error: str | None = None
    data: Any = None
