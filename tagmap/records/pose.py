"""An absolute pose with everything a user needs to judge it."""

from typing import Literal, TypeAlias

from tagmap.records.base import Finite, Message, SessionId, TimeNs, Vector
from tagmap.records.transform import Transform

Gauge: TypeAlias = Literal["floating", "anchored"]
PoseState: TypeAlias = Literal["good", "degraded", "lost"]


class Pose(Message, frozen=True, kw_only=True):
    """Pose of one robot at `t_ns`.

    T_map_base, T_map_odom  null while lost
    cov                     of T_map_base, body frame, (v, omega); null while lost
    state                   never `good` on a floating map
    dop                     position dilution of the tags seen last, m per m; null while they do
                            not determine a pose
    protection_level_m      bound on the position error, also if one of these tags is wrong; null
                            where nothing can be promised, as without one of three tags
    source                  who computed it: the service, or the agent on board
    """

    T_map_base: Transform | None
    T_map_odom: Transform | None
    robot_session: SessionId
    cov: Vector | None
    map_version: int | None
    gauge: Gauge
    state: PoseState
    dop: Finite | None
    protection_level_m: Finite | None
    source: Literal["service", "agent"]
    t_ns: TimeNs
