"""`[[event]]`: what happens to tags and robots. `[[fault]]`: what breaks around them."""

from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from fleet.simulation.scenario.fields import Degrees, Point3, Seconds, Table, TagRef
from tagmap.records.base import Name

EventKind: TypeAlias = Literal[
    "moved", "swapped", "covered", "uncovered", "dead", "duplicated", "kidnapped", "battery-swap"
]
FaultKind: TypeAlias = Literal[
    "kill-agent",
    "kill-service",
    "kill-router",
    "partition",
    "heal",
    "slow-consumer",
    "duplicate",
    "reorder",
    "corrupt",
    "full-disk",
    "clock-jump",
    "power-cut-write",
    "battery-swap",
]
OF_ROBOTS = ("kidnapped", "battery-swap")
NEED_ROBOT = ("kill-agent", "clock-jump", "power-cut-write", "battery-swap")
NEED_NOBODY = ("kill-service", "kill-router")


class Event(Table, frozen=True, kw_only=True):
    """moved       the tags hang at to_m, or by_m from where they were
    swapped     two tags hang where the other did; of both takes_s: meanwhile somebody has them in
                the hands, and nobody sees or lights them
    covered     nobody sees them and no laser reaches them, until `uncovered`
    dead        they shine on and never answer
    duplicated  another tag of the same EPC hangs at to_m
    kidnapped   the robot is carried to to_m (z is ignored) and faces heading_deg; its odometry
                starts anew
    battery-swap  the robot's odometry starts anew where it is
    """

    at_s: Seconds
    kind: EventKind
    tags: tuple[TagRef, ...] = ()
    robot: Name | None = None
    to_m: Point3 | None = None
    by_m: Point3 | None = None
    heading_deg: Degrees = 0.0
    carry_s: Seconds = 8.0
    takes_s: Seconds = 10.0

    def __post_init__(self) -> None:
        problem = _wrong_with(self)
        if problem:
            raise ValueError(f"{self.kind}: {problem}")


def _wrong_with(event: Event) -> str | None:
    if event.kind in OF_ROBOTS:
        if event.robot is None or event.tags:
            return "expected a robot and no tags"
        if event.kind == "kidnapped" and event.to_m is None:
            return "to_m is missing, expected where the robot is carried to"
        return None
    if not event.tags or event.robot is not None:
        return "expected tags and no robot"
    if event.kind == "swapped" and len(event.tags) != 2:
        return f"{len(event.tags)} tags, expected two"
    if event.kind == "moved" and (event.to_m is None) == (event.by_m is None):
        return "expected either to_m or by_m"
    one_place = event.kind == "duplicated" or (event.kind == "moved" and event.to_m is not None)
    if one_place and (len(event.tags) != 1 or event.to_m is None):
        return "expected one tag and to_m"
    return None


class Fault(Table, frozen=True, kw_only=True):
    """target: a robot, `service`, or nothing where there is only one or all are meant.
    for_s: how long it lasts, 0: until something ends it. by_s: how far a clock jumps."""

    at_s: Seconds
    kind: FaultKind
    target: Name | None = None
    for_s: Seconds = 0.0
    by_s: Annotated[float, Meta(ge=-1e9, le=1e9)] = 0.0

    def __post_init__(self) -> None:
        if self.kind in NEED_ROBOT and self.target in (None, "service"):
            raise ValueError(f"{self.kind}: target is missing, expected the name of a robot")
        if self.kind in NEED_NOBODY and self.target is not None:
            raise ValueError(f"{self.kind}: target is {self.target}, expected none")
