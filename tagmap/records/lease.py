"""Activation leases: who may shoot now."""

from typing import Annotated

from msgspec import Meta

from tagmap.records.base import Message, Name
from tagmap.records.rig import Positive


class LeaseRequest(Message, frozen=True, kw_only=True):
    robot: Name
    wanted_s: Positive


class LeaseReply(Message, frozen=True, kw_only=True):
    """`lease` null: not now, ask again after `retry_s`."""

    lease: int | None
    valid_s: Annotated[float, Meta(ge=0.0)]
    retry_s: Annotated[float, Meta(ge=0.0)]
