"""Write-back: what goes into a tag's memory, and what came of it."""

from typing import Literal

from tagmap.records.base import Message, Name, Positive, TagId


class WriteJob(Message, frozen=True, kw_only=True):
    """Write `record` to the memory of `tag` within `valid_s`. Idempotent by `job`."""

    job: int
    tag: TagId
    record: bytes
    valid_s: Positive


class JobResult(Message, frozen=True, kw_only=True):
    """`read`: the tag's whole memory as the robot read it back; null when it could not be read."""

    robot: Name
    job: int
    tag: TagId
    outcome: Literal["written", "failed", "expired"]
    read: bytes | None
    reason: str | None = None
