"""What the agent asks of a pan-tilt unit, and every way in which that ends.

As with readers, nothing here raises for what happens on the line: the answer is a result or a
`Failure`, and the agent goes on with the cameras where they are.
"""

from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

Reason: TypeAlias = Literal["unit_gone", "refused", "out_of_reach"]
"""unit_gone     no port, no sensible answer, or the line broke; a move may have been begun
refused       the unit understood and will not
out_of_reach  the angle is outside the limits; nothing was sent
"""


@dataclass(frozen=True, slots=True)
class Failure:
    """detail: one line for people."""

    reason: Reason
    detail: str


@dataclass(frozen=True, slots=True)
class Angles:
    """rad; pan is positive to the left, tilt is positive upwards."""

    pan_rad: float
    tilt_rad: float


@dataclass(frozen=True, slots=True)
class AxisSample:
    """One axis was at `angle_rad`, exact to a step of `step_rad`, at some time within `within_ns`
    of `t_ns` (UTC)."""

    t_ns: int
    within_ns: int
    angle_rad: float
    step_rad: float


@dataclass(frozen=True, slots=True)
class Reading:
    """The two axes are asked one after the other, so each has a time of its own."""

    pan: AxisSample
    tilt: AxisSample

    @property
    def angles(self) -> Angles:
        return Angles(self.pan.angle_rad, self.tilt.angle_rad)


@dataclass(frozen=True, slots=True)
class AxisReach:
    """Limits and step in rad, greatest speed in rad/s, acceleration in rad/s^2."""

    least_rad: float
    most_rad: float
    step_rad: float
    speed_rad_s: float
    acceleration_rad_s2: float


@dataclass(frozen=True, slots=True)
class UnitInfo:
    """What a unit says it is and can do."""

    address: str
    firmware: str
    pan: AxisReach
    tilt: AxisReach


class PanTilt(Protocol):
    """A unit that turns the cameras. Calls may come from any thread and wait for each other."""

    def probe(self) -> UnitInfo | Failure:
        """Connect if need be and ask the unit what it is. Nothing moves."""

    def move(self, angles: Angles) -> Angles | Failure:
        """Start towards `angles` and return at once, with them rounded to whole steps. A move
        under way is changed on the fly."""

    def read(self) -> Reading | Failure:
        """Where the axes are now, also while they move."""

    def set_speed(self, speed_rad_s: float) -> Failure | None:
        """How fast both axes turn from now on."""

    def halt(self) -> Failure | None:
        """Stop where it is."""

    def close(self) -> None:
        """Let go of the unit, which stays where it is. The next call connects again."""
