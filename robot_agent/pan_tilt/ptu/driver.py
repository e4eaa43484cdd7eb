"""A PTU on a serial line as the agent knows pan-tilt units."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, TypeAlias, TypeVar

import msgspec
from msgspec import Meta

from robot_agent.backoff import Backoff
from robot_agent.pan_tilt.ptu.line import Line, LineLost, pyserial
from robot_agent.pan_tilt.ptu.replies import Refused
from robot_agent.pan_tilt.unit import (
    Angles,
    AxisReach,
    AxisSample,
    Failure,
    PanTilt,
    Reading,
    Reason,
    UnitInfo,
)

T = TypeVar("T")

ARCSEC_RAD = math.pi / 180.0 / 3600.0
PAN, TILT = "P", "T"
SLACK_STEPS = 3.0

Angle: TypeAlias = Annotated[float, Meta(ge=-7.0, le=7.0)]
Limits: TypeAlias = tuple[Angle, Angle]


class PtuConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the unit is and how it may turn. Limits narrow those that the unit found itself."""

    port: str
    baud: Annotated[int, Meta(ge=600, le=115200)] = 9600
    echo: bool = True
    answer_s: Annotated[float, Meta(ge=0.05, le=60.0)] = 0.5
    speed_rad_s: Annotated[float, Meta(gt=0.0, le=10.0)] | None = None
    pan_limits_rad: Limits | None = None
    tilt_limits_rad: Limits | None = None

    def __post_init__(self) -> None:
        for name in ("pan_limits_rad", "tilt_limits_rad"):
            limits = getattr(self, name)
            if limits is not None and not limits[0] < limits[1]:
                raise ValueError(f"{name} is {list(limits)}, expected least and most")


@dataclass(frozen=True, slots=True)
class _Axis:
    """`latest`: the position that was believed last."""

    letter: str
    name: str
    reach: AxisReach
    latest: AxisSample | None = None


class PtuUnit(PanTilt):
    """PanTilt by serial line. Connects when it is first asked for something, again whenever the
    line was lost, and waits longer from failure to failure: a call in between says so at once.
    Raises SerialUnavailable at construction when pyserial is not installed.
    """

    def __init__(self, config: PtuConfig) -> None:
        pyserial()
        self._config = config
        self._line: Line | None = None
        self._axes: dict[str, _Axis] = {}
        self._backoff = Backoff()
        self._one_at_a_time = threading.Lock()

    def probe(self) -> UnitInfo | Failure:
        def ask(line: Line) -> UnitInfo:
            firmware = line.ask("V", self._config.echo)
            pan, tilt = self._axes[PAN].reach, self._axes[TILT].reach
            return UnitInfo(self._config.port, firmware, pan, tilt)

        return self._attempt(ask)

    def move(self, angles: Angles) -> Angles | Failure:
        def begin(line: Line) -> Angles | Failure:
            targets = {PAN: angles.pan_rad, TILT: angles.tilt_rad}
            for letter, target_rad in targets.items():
                wrong = _outside(self._axes[letter], target_rad)
                if wrong:
                    return Failure("out_of_reach", wrong)
            # Both may go: only now is anything sent.
            rounded = [self._begin(line, letter, targets[letter]) for letter in (PAN, TILT)]
            return Angles(*rounded)

        return self._attempt(begin)

    def read(self) -> Reading | Failure:
        return self._attempt(
            lambda line: Reading(self._position(line, PAN), self._position(line, TILT))
        )

    def set_speed(self, speed_rad_s: float) -> Failure | None:
        return self._attempt(lambda line: self._set_speed(line, speed_rad_s))

    def halt(self) -> Failure | None:
        def stop(line: Line) -> None:
            line.ask("H", self._config.echo)

        return self._attempt(stop)

    def close(self) -> None:
        with self._one_at_a_time:
            self._hang_up()

    def _attempt(self, operation: Callable[[Line], T]) -> T | Failure:
        """The one place where the line's troubles become failures."""
        with self._one_at_a_time:
            wait_s = self._backoff.wait_s(time.monotonic())
            if self._line is None and wait_s > 0.0:
                return self._failure(
                    "unit_gone", f"no connection, the next try is in {wait_s:.1f} s"
                )
            try:
                result = operation(self._connected())
            except LineLost as error:
                self._hang_up()
                self._backoff.failed(time.monotonic())
                return self._failure("unit_gone", error)
            except Refused as error:
                if self._line is None:
                    self._backoff.failed(time.monotonic())
                return self._failure("refused", error)
            self._backoff.succeeded()
            return result

    def _failure(self, reason: Reason, why: object) -> Failure:
        return Failure(reason, f"pan-tilt unit {self._config.port}: {why}")

    def _connected(self) -> Line:
        if self._line is None:
            config = self._config
            line = Line(config.port, config.baud, config.answer_s)
            try:
                self._prepare(line)
            except (LineLost, Refused):
                line.close()
                raise
            self._line = line
        return self._line

    def _prepare(self, line: Line) -> None:
        """Terse answers with echo, moves at once. Limits stay as people set them in the unit: LE
        would widen those of an E series. Nothing goes to the EEPROM, and nothing moves."""
        config = self._config
        line.quieten()
        line.ask("EE" if config.echo else "ED", None)
        for command in ("FT", "I"):
            line.ask(command, config.echo)
        for letter, name in ((PAN, "pan"), (TILT, "tilt")):
            limits = getattr(config, f"{name}_limits_rad")
            self._axes[letter] = _Axis(letter, name, self._reach(line, letter, limits))
        if config.speed_rad_s is not None:
            self._set_speed(line, config.speed_rad_s)

    def _reach(self, line: Line, letter: str, limits: Limits | None) -> AxisReach:
        def ask(what: str) -> float:
            return line.ask_constant(letter + what, self._config.echo)

        step_rad = ask("R") * ARCSEC_RAD
        least_rad, most_rad = ask("N") * step_rad, ask("X") * step_rad
        if not (step_rad > 0.0 and least_rad < most_rad):
            raise LineLost(f"{letter}R, {letter}N, {letter}X: no step and limits of an axis")
        if limits is not None:
            if limits[0] > most_rad or limits[1] < least_rad:
                raise Refused(f"it turns from {least_rad:.4f} to {most_rad:.4f} rad, not {limits}")
            least_rad, most_rad = max(least_rad, limits[0]), min(most_rad, limits[1])
        return AxisReach(least_rad, most_rad, step_rad, ask("U") * step_rad, ask("A") * step_rad)

    def _begin(self, line: Line, letter: str, target_rad: float) -> float:
        step_rad = self._axes[letter].reach.step_rad
        steps = round(target_rad / step_rad)
        line.ask(f"{letter}P{steps}", self._config.echo)
        return steps * step_rad

    def _set_speed(self, line: Line, speed_rad_s: float) -> None:
        for letter in (PAN, TILT):
            steps_s = round(speed_rad_s / self._axes[letter].reach.step_rad)
            line.ask(f"{letter}S{steps_s}", self._config.echo)

    def _position(self, line: Line, letter: str) -> AxisSample:
        """The first position, and one that the axis cannot have reached since the one before, is
        believed only if it is said twice: a number that lost a digit is a number too."""
        axis = self._axes[letter]
        sample = self._sample(line, axis)
        if not _is_reachable(axis.reach, axis.latest, sample):
            again = self._sample(line, axis)
            if not _is_reachable(axis.reach, sample, again):
                raise LineLost(
                    f"{axis.name} jumps from {sample.angle_rad:.4f} to {again.angle_rad:.4f} rad"
                )
            sample = again
        self._axes[letter] = replace(axis, latest=sample)
        return sample

    def _sample(self, line: Line, axis: _Axis) -> AxisSample:
        steps = line.ask_number(f"{axis.letter}P", self._config.echo)
        within_ns = (time.time_ns() - line.asked_ns) // 2
        step_rad = axis.reach.step_rad
        return AxisSample(line.asked_ns + within_ns, abs(within_ns), steps * step_rad, step_rad)

    def _hang_up(self) -> None:
        self._axes = {}
        if self._line is not None:
            self._line.close()
            self._line = None


def _is_reachable(reach: AxisReach, before: AxisSample | None, after: AxisSample) -> bool:
    if before is None:
        return False
    seconds = 1e-9 * (abs(after.t_ns - before.t_ns) + before.within_ns + after.within_ns)
    far_rad = reach.speed_rad_s * seconds + SLACK_STEPS * reach.step_rad
    return abs(after.angle_rad - before.angle_rad) <= far_rad


def _outside(axis: _Axis, target_rad: float) -> str | None:
    """What is wrong with a target, which is rounded to whole steps; None: nothing."""
    least_rad, most_rad, half_rad = (
        axis.reach.least_rad,
        axis.reach.most_rad,
        axis.reach.step_rad / 2,
    )
    if least_rad - half_rad < target_rad < most_rad + half_rad:
        return None
    return f"{axis.name} {target_rad:.4f} rad, expected {least_rad:.4f} to {most_rad:.4f} rad"
