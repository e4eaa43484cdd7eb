"""`[[robot]]`: who drives where, with what."""

from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from fleet.simulation.scenario.fields import (
    Degrees,
    Length,
    Point2,
    Point3,
    Seconds,
    Size3,
    Table,
)
from tagmap.records.base import Name, RobotNumber

Rate: TypeAlias = Annotated[float, Meta(gt=0.0, le=100.0)]
Ppm: TypeAlias = Annotated[float, Meta(ge=-1e4, le=1e4)]
Pitch: TypeAlias = Annotated[float, Meta(ge=-90.0, le=90.0)]


class Route(Table, frozen=True, kw_only=True):
    """Along `waypoints_m`, stopping at each and every `every_m` between; without any, a random tour
    through free space, in `area_m` (least x, y, most x, y) if given.

    loop: from the last waypoint on to the first, or back the way it came.
    wait_s: before it starts.
    """

    waypoints_m: tuple[Point2, ...] = ()
    loop: bool = True
    area_m: tuple[float, float, float, float] | None = None
    every_m: Length = 0.8
    stop_s: Seconds = 2.0
    wait_s: Seconds = 1.0
    speed_m_s: Rate = 0.5
    acceleration_m_s2: Rate = 0.5
    turn_rad_s: Rate = 0.8
    turn_rad_s2: Rate = 1.6

    def __post_init__(self) -> None:
        if self.waypoints_m and self.area_m is not None:
            raise ValueError("area_m is for random tours, waypoints_m are given")
        if self.area_m is not None and not (
            self.area_m[0] < self.area_m[2] and self.area_m[1] < self.area_m[3]
        ):
            raise ValueError(
                f"area_m is {list(self.area_m)}, expected least x, least y, most x, most y"
            )


class Robot(Table, frozen=True, kw_only=True):
    """Without name and number: r1, r2, ... and 1, 2, ... in the order of the file.

    rig                a preset, or a file beside the scenario
    camera_p_m, camera_pitch_deg  the left camera in base, and how far it looks up; with pan-tilt
                       at angles 0
    camera_hz          pairs of images per second
    sight_m            farther tags are none of its business
    """

    name: Name | None = None
    number: RobotNumber | None = None
    rig: str = "wide-angle"
    mounting: Literal["fixed", "pan-tilt"] = "fixed"
    camera_p_m: Point3 = (0.10, 0.15, 0.60)
    camera_pitch_deg: Pitch = 35.0
    drive: Literal["differential", "omni"] = "differential"
    clock_offset_s: Annotated[float, Meta(ge=-1e6, le=1e6)] = 0.0
    clock_drift_ppm: Ppm = 0.0
    body_m: Size3 = (0.5, 0.4, 0.5)
    heading_deg: Degrees = 0.0
    camera_hz: Rate = 4.0
    sight_m: Length = 8.0
    route: Route = Route()
