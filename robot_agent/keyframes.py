"""Which exposures become keyframes: enough of them, and not the same view again and again."""

from dataclasses import dataclass

import msgspec

from robot_agent.odometry.odometry import OdomPose
from tagmap.geometry import se3


class Spacing(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A keyframe after so much of a way, a turn or time since the one before, or with a new name.
    `still_s`: while the robot stands."""

    way_m: float = 0.2
    turn_rad: float = 0.1
    moving_s: float = 0.5
    still_s: float = 2.0

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            if not 0.0 < getattr(self, name) <= 3600.0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected more than 0")


@dataclass(frozen=True, slots=True)
class Moment:
    """An exposure: when, where by odometry (None: not known), and what had a name."""

    t_ns: int
    odom: OdomPose | None
    tags: frozenset[str]
    is_still: bool


def is_due(spacing: Spacing, last: Moment | None, now: Moment) -> bool:
    if last is None or not now.tags <= last.tags:
        return True
    since_s = 1e-9 * (now.t_ns - last.t_ns)
    # The clock was set back: how long it is nobody knows.
    if since_s < 0.0 or since_s >= (spacing.still_s if now.is_still else spacing.moving_s):
        return True
    if last.odom is None or now.odom is None or last.odom.epoch != now.odom.epoch:
        return (last.odom is None) != (now.odom is None)
    xi = se3.log(se3.inverse(last.odom.T_odom_base) @ now.odom.T_odom_base)
    way_m, turn_rad = float((xi[:3] ** 2).sum() ** 0.5), float((xi[3:] ** 2).sum() ** 0.5)
    return way_m >= spacing.way_m or turn_rad >= spacing.turn_rad
