"""Activation leases: who may shoot now."""

from typing import Annotated

from msgspec import Meta

from tagmap.records.base import Message, Name, NotNegative, Vector, check_finite


class LeaseRequest(Message, frozen=True, kw_only=True):
    """`wanted_s` 0: none, the robot only gives `done` back: a lease after which its laser is off.

    p_m, radius_m  the robot is in map within `radius_m` of `p_m`, as it asks; null: nobody knows
    """

    robot: Name
    wanted_s: NotNegative
    p_m: Vector | None = None
    radius_m: NotNegative = 0.0
    done: Annotated[int, Meta(ge=0, le=2**63 - 1)] | None = None

    def __post_init__(self) -> None:
        if self.p_m is not None:
            check_finite("p_m", self.p_m, [2, 3])


class LeaseReply(Message, frozen=True, kw_only=True):
    """`valid_s` counts from before asking. `lease` null: not now, ask again after `retry_s`."""

    lease: int | None
    valid_s: NotNegative
    retry_s: NotNegative
