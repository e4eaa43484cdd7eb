"""Activation leases: who may shoot now."""

from tagmap.records.base import Message, Name, NotNegative, Positive


class LeaseRequest(Message, frozen=True, kw_only=True):
    robot: Name
    wanted_s: Positive


class LeaseReply(Message, frozen=True, kw_only=True):
    """`lease` null: not now, ask again after `retry_s`."""

    lease: int | None
    valid_s: NotNegative
    retry_s: NotNegative
