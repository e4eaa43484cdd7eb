"""One axis of a stepper-driven unit: speed, acceleration, limits."""

import math
from dataclasses import dataclass

STEP_S = 1e-3
NS = 1_000_000_000
LONGEST_NS = 60 * NS
"""Nothing takes an axis longer: after a longer pause it has arrived."""


@dataclass(slots=True)
class Axis:
    """Positions, speeds (positions/s) and acceleration as the unit counts them. Speeds up to `base`
    are taken at once, as steppers do (manual 4.4.1, figure 4); above it the profile is trapezoidal.
    """

    arcsec: float
    least: int
    most: int
    speed: int = 1000
    acceleration: int = 2000
    base: int = 1000
    lower: int = 57
    upper: int = 2902
    target: int = 0
    position: float = 0.0
    velocity: float = 0.0

    @property
    def at_rest(self) -> bool:
        return self.velocity == 0.0 and self.position == self.target

    def turn(self, duration_ns: int) -> None:
        """Go on for so long."""
        for _ in range(round(min(duration_ns, LONGEST_NS) / (STEP_S * NS))):
            if self.at_rest:
                return
            self._step()

    def halt(self) -> None:
        self.velocity = 0.0
        self.target = round(self.position)
        self.position = float(self.target)

    def _step(self) -> None:
        to_go = self.target - self.position
        braking = math.sqrt(self.base**2 + 2.0 * self.acceleration * abs(to_go))
        wanted = math.copysign(min(self.speed, braking), to_go)
        gain = self.acceleration * STEP_S
        if self.velocity * wanted >= 0.0:
            fastest = max(self.base, abs(self.velocity) + gain)
            slowest = abs(self.velocity) - gain if abs(self.velocity) > self.base else 0.0
            self.velocity = math.copysign(max(min(abs(wanted), fastest), slowest), wanted)
        elif abs(self.velocity) > self.base:
            self.velocity -= math.copysign(gain, self.velocity)
        else:
            self.velocity = 0.0
        if self.velocity * to_go > 0.0 and abs(to_go) <= abs(self.velocity) * STEP_S:
            self.position, self.velocity = float(self.target), 0.0
        else:
            self.position += self.velocity * STEP_S
