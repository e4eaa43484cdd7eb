"""`[agent]` of robot.toml: how the agent works, with complete defaults."""

from dataclasses import replace
from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

from robot_agent.activation.rules import ShotRules
from robot_agent.keyframes import Spacing
from robot_agent.perception.spots import Optics
from tagmap.arbitration.blink import BlinkRules

Positive: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e3)]
NotNegative: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e5)]
SHOTS = ShotRules()


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the file; an unknown key is refused."""


class SpotsTable(_Table, frozen=True):
    """What spots look like, see robot_agent.perception.spots.Optics."""

    sigma_px: tuple[Positive, Positive] = (0.5, 4.0)
    gain: NotNegative = 0.0
    full_scale: Annotated[int, Meta(ge=1, le=65535)] | None = None
    threshold: Positive = 4.5

    def __post_init__(self) -> None:
        if not self.sigma_px[0] < self.sigma_px[1]:
            raise ValueError(f"sigma_px is {list(self.sigma_px)}, expected least and largest")

    def optics(self) -> Optics:
        return Optics(self.sigma_px, self.gain, self.full_scale, self.threshold)


class ShotsTable(_Table, frozen=True):
    """What a shot costs and must show, see robot_agent.activation.rules.ShotRules."""

    reach_m: Positive = SHOTS.reach_m
    threshold_m: Positive = SHOTS.threshold_m
    window_s: Annotated[float, Meta(ge=0.01, le=1.0)] = SHOTS.window_s
    margin_s: Annotated[float, Meta(ge=0.005, le=0.2)] = SHOTS.margin_s
    settle_s: Annotated[float, Meta(ge=0.0, le=0.2)] = SHOTS.settle_s
    memory_s: Annotated[float, Meta(ge=0.0, le=1.0)] = SHOTS.memory_s
    write_s: Annotated[float, Meta(ge=0.01, le=1.0)] = SHOTS.write_s
    most_shots: Annotated[int, Meta(ge=1, le=200)] = SHOTS.most_shots

    def rules(self) -> ShotRules:
        return ShotRules(**{name: getattr(self, name) for name in self.__struct_fields__})

    def blink_rules(self) -> BlinkRules:
        """A slot is the longer the slower the line to the reader."""
        usual = BlinkRules()
        guard_s = max(usual.guard_s, usual.guard_s + self.margin_s - SHOTS.margin_s)
        slot_s = usual.slot_s + (guard_s - usual.guard_s)
        return replace(usual, slot_s=slot_s, guard_s=guard_s)


class AgentTable(_Table, frozen=True):
    """
    grab_s      how long to wait for an exposure
    confirm_s   a name that rests on position alone is lit again after so long, one that was
                followed since it was lit after four times that; 0: never
    stationary  the robot never moves, so it needs no odometer
    """

    grab_s: Annotated[float, Meta(ge=0.05, le=10.0)] = 1.0
    confirm_s: NotNegative = 30.0
    stationary: bool = False
    keyframes: Spacing = Spacing()
    spots: SpotsTable = SpotsTable()
    shots: ShotsTable = ShotsTable()
