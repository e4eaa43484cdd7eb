"""A target's search as steps of the drive, with the doubt that each place leaves."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robot_agent.activation.rules import ShotRules
from robot_agent.activation.search import Search, p_beside, plan, spread
from robot_agent.activation.target import Target
from robot_agent.laser.device import Steps
from tagmap.conventions import Array
from tagmap.geometry.scanner.aiming import Aims, aim, beside, why_not
from tagmap.geometry.scanner.drive import Drive, angles_of, nearest_steps, volts
from tagmap.geometry.scanner.scanner import Scanner, point

NEARER = 0.9
ABREAST = (0.6, 0.8)
"""Of the reach: where the depth is right it is lit from there too, if aimed well. The farther out,
the less room is left for other tags."""
SHARP_SIGMAS, SURE_SIGMAS = 2.5, 3.0
"""Of the aim, from there to the edge of the reach: at least to be tried, and as chosen."""


@dataclass(frozen=True, slots=True)
class Place:
    """`steps` give the angles theta (2,), the beam passes the target by offset_m (2,); p_beside:
    that what is lit there is another tag."""

    steps: Steps
    theta: Array
    offset_m: Array
    p_beside: float


@dataclass(frozen=True, slots=True)
class Aimer:
    scanner: Scanner
    drive: Drive
    rules: ShotRules

    def places(self, target: Target) -> "Places | str":
        """Where to shoot, or why that cannot be."""
        aims = aim(self.scanner, self.drive, target.p_cam, target.cov_cam)
        if why := why_not(self.drive, aims, target.p_cam):
            return why
        cov_m = spread(self.scanner, aims, target.p_cam)
        rules = self.rules
        search = plan(cov_m, rules.reach_m, rules.most_shots, rules.search_sigmas)
        theta = np.broadcast_to(aims.theta, (len(target.others), 2))
        there = point(self.scanner, theta, target.others)
        with np.errstate(invalid="ignore"):
            ahead = np.isfinite(there.off).all(axis=1) & (there.ahead > 0.0)
        weights = None if target.weights is None else target.weights[ahead]
        return Places(self, target, aims, search, there.off[ahead], weights)

    def steps_at(self, theta: Array) -> Steps | None:
        """None where mirrors or volts cannot."""
        drive = self.drive
        v = volts(drive, theta)
        inside = (theta >= drive.limits_rad[:, 0]) & (theta <= drive.limits_rad[:, 1])
        inside &= (v >= drive.limits_v[0]) & (v <= drive.limits_v[1])
        if not inside.all():
            return None
        x, y = nearest_steps(drive, theta).tolist()
        return x, y


@dataclass(frozen=True, slots=True)
class Places:
    """The likeliest first. `others_m` (M, 2): by how much the beam at the target passes others,
    with the target's weights (M,)."""

    aimer: Aimer
    target: Target
    aims: Aims
    search: Search
    others_m: Array
    weights: Array | None = None

    def __iter__(self) -> Iterator[Place]:
        for offset_m in self.search.offsets_m:
            place = self.beside(offset_m)
            if place is not None:
                yield place

    def beside(self, offset_m: Array) -> Place | None:
        """None where the mirrors do not reach."""
        aimer = self.aimer
        theta = beside(aimer.scanner, self.aims.theta, self.target.p_cam, offset_m)
        steps = aimer.steps_at(theta)
        if steps is None:
            return None
        doubt = p_beside(self.search, offset_m, self.others_m, aimer.rules.reach_m, self.weights)
        return Place(steps, angles_of(aimer.drive, np.array(steps)), offset_m, doubt)

    @property
    def is_sharp(self) -> bool:
        """Whether the aim is so good that a beam ABREAST of the target lights it all the same."""
        sigma_m = float(np.sqrt(np.linalg.eigvalsh(self.search.cov_m)[-1]))
        return SHARP_SIGMAS * sigma_m <= (1.0 - ABREAST[0]) * self.aimer.rules.reach_m

    def abreast(self, place: Place, across: bool = False) -> list[Place]:
        """To both sides of a place, where a tag at another depth on the same ray of the left camera
        would come to lie; or `across` that, where no tag on that ray comes to lie."""
        scanner, p_cam = self.aimer.scanner, self.target.p_cam
        nearer = point(scanner, self.aims.theta, NEARER * p_cam).off
        shift = nearer - point(scanner, self.aims.theta, p_cam).off
        shift = np.array([-shift[1], shift[0]]) if across else shift
        step_m = self._step_m(shift / np.sqrt((shift**2).sum()))
        sides = [self.beside(place.offset_m + side * step_m) for side in (1.0, -1.0)]
        return [side for side in sides if side is not None]

    def _step_m(self, direction: Array) -> Array:
        """Along a unit vector (2,): as near to the edge of the reach as the aim allows."""
        reach_m = self.aimer.rules.reach_m
        sigma_m = np.sqrt(direction @ self.search.cov_m @ direction)
        step: Array = direction * reach_m * np.clip(1.0 - SURE_SIGMAS * sigma_m / reach_m, *ABREAST)
        return step
