"""Poses of the past: between two keyframes of one session, never outside."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se2, se3
from tagmap.records import Pose
from tagmap.records.arrays import transform, vector
from tagmap.records.pose import Gauge


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A pose of a session: T_map_base (d, d), cov (k,) packed upper or None when not computed."""

    session: str
    t_ns: int
    T_map_base: Array
    cov: Array | None


def bracket(moments: Iterable[Moment], t_ns: int) -> tuple[Moment, Moment] | None:
    """The two moments around `t_ns`, of one session; the same one twice on a hit."""
    before: Moment | None = None
    after: Moment | None = None
    for moment in moments:
        if moment.t_ns <= t_ns and (before is None or moment.t_ns >= before.t_ns):
            before = moment
        if moment.t_ns >= t_ns and (after is None or moment.t_ns <= after.t_ns):
            after = moment
    if before is None or after is None or before.session != after.session:
        return None
    return before, after


def pose_between(
    before: Moment, after: Moment, t_ns: int, map_version: int | None, gauge: Gauge
) -> Pose:
    """Constant twist between the two; the covariance is blended likewise, null unless both known.

    T_map_odom is null: the pose is of the map, not of the odometry at that time.
    """
    span = after.t_ns - before.t_ns
    s = (t_ns - before.t_ns) / span if span else 0.0
    group = se3 if before.T_map_base.shape[-1] == 4 else se2
    T = group.interpolate(before.T_map_base, after.T_map_base, s)
    cov = _blend(before.cov, after.cov, s)
    return Pose(
        T_map_base=transform(T),
        T_map_odom=None,
        robot_session=before.session,
        cov=None if cov is None else vector(cov),
        map_version=map_version,
        gauge=gauge,
        state="good" if gauge == "anchored" else "degraded",
        dop=None,
        protection_level_m=None,
        source="service",
        t_ns=t_ns,
    )


def describe_range(spans: Sequence[tuple[int, int]]) -> str:
    """The times for which there are poses, for an error message."""
    if not spans:
        return "none yet"
    return ", ".join(f"{first}..{last}" for first, last in sorted(spans)[-8:])


def _blend(a: Array | None, b: Array | None, s: float) -> Array | None:
    if a is None or b is None or not (np.isfinite(a).all() and np.isfinite(b).all()):
        return None
    return (1.0 - s) * a + s * b
