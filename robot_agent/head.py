"""Turning the cameras: where the unit was sent, and whether it has come to rest there."""

from dataclasses import dataclass

from robot_agent.pan_tilt.mounting import Angling, CameraPose
from robot_agent.pan_tilt.unit import Angles, Failure, PanTilt

SAME_RAD = 2e-3
UNKNOWN = 3
"""Exposures in a row whose angles come too late: a single one is nothing to speak of."""
PATIENCE_NS = 10_000_000_000
"""A unit that has not arrived by then is stuck: it is looked at where it is."""


@dataclass(slots=True)
class Head:
    unit: PanTilt
    poller: Angling
    _target: Angles | None = None
    _sent_ns: int = 0
    _before: Angles | None = None
    _refusal: str | None = None
    _unknown: int = 0

    def turn(self, angles: Angles, now_ns: int) -> None:
        moving = self.unit.move(angles)
        self._refusal = moving.detail if isinstance(moving, Failure) else None
        self._target = None if isinstance(moving, Failure) else moving
        self._sent_ns = now_ns

    def is_still(self, angles: Angles | None, now_ns: int) -> bool:
        """At two exposures in a row where it was, and where it was sent, if it was."""
        before, self._before = self._before, angles
        if angles is None or before is None or not _same(angles, before):
            return False
        is_there = self._target is None or _same(angles, self._target)
        return is_there or now_ns - self._sent_ns > PATIENCE_NS

    def trouble(self, camera: CameraPose | None) -> str | None:
        """Why it is not known where the camera looks, or why it does not turn."""
        failure = self.poller.failure
        if failure is not None:
            return failure.detail
        self._unknown = self._unknown + 1 if camera is None else 0
        if self._unknown >= UNKNOWN:
            return "no angles around the times of exposures"
        return self._refusal


def _same(a: Angles, b: Angles) -> bool:
    return max(abs(a.pan_rad - b.pan_rad), abs(a.tilt_rad - b.tilt_rad)) <= SAME_RAD
