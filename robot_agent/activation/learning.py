"""What identified tags teach about the scanner: now and then one is probed for its middle."""

from dataclasses import dataclass, replace

import numpy as np

from robot_agent.activation.aimer import Aimer, Places
from robot_agent.activation.commands import Act, Dark
from robot_agent.activation.rules import ShotRules
from robot_agent.activation.verdict import Outcome, distance_m
from robot_agent.activation.window import lit, turn_to
from robot_agent.calibration.scanner.online import Hit, Online, absorb, warning
from robot_agent.calibration.scanner.probing import line, middle, sigma_middle_m
from tagmap.conventions import Array
from tagmap.geometry.scanner.aiming import beside

SPACING_M = 0.008
EACH_SIDE = 4
SIGMA_THETA_RAD = 3e-4
WINDOW_S, MARGIN_S = 0.03, 0.005


def quick(rules: ShotRules) -> ShotRules:
    """The tag is known already: it need only answer once."""
    return replace(rules, window_s=WINDOW_S, margin_s=MARGIN_S)


def probe_s(rules: ShotRules) -> float:
    """How long probing takes, the mirrors' turns left out."""
    return 2 * (2 * EACH_SIDE + 1) * quick(rules).shot_s


@dataclass(frozen=True, slots=True)
class Lesson:
    """`warning`: the mount has turned, and by how much."""

    online: Online
    warning: str | None


def probe(aimer: Aimer, outcome: Outcome) -> Act[Hit | None]:
    """Two lines of shots across an identified tag; None where its edges were not found.

    Under the lease of the shot, which must last for probe_s.
    """
    places = aimer.places(outcome.target)
    theta, tag = outcome.verdict.theta, outcome.verdict.tag
    if isinstance(places, str) or theta is None or tag is None:
        return None
    centre_m = np.zeros(2)
    for axis in (0, 1):
        offsets_m = line(axis, centre_m, SPACING_M, EACH_SIDE)
        lights = np.zeros(len(offsets_m), dtype=bool)
        for k, offset_m in enumerate(offsets_m):
            window = yield from _at(places, theta, offset_m)
            if window is None:
                yield Dark()
                return None
            lights[k] = tag in window
        found = middle(offsets_m, lights)
        if found is None:
            yield Dark()
            return None
        centre_m = found
    yield Dark()
    return _hit(aimer, outcome, theta, centre_m)


def learn(online: Online, hit: Hit, outcome: Outcome) -> Lesson:
    """Aim with `online.scanner` from now on."""
    try:
        online = absorb(online, hit)
    except np.linalg.LinAlgError:
        # Hits of one and the same place leave a turn of the mount open.
        return Lesson(online, None)
    return Lesson(online, warning(online, distance_m(outcome.target)))


def with_lesson(aimer: Aimer, lesson: Lesson) -> Aimer:
    return replace(aimer, scanner=lesson.online.scanner)


def _at(places: Places, theta: Array, offset_m: Array) -> Act[frozenset[str] | None]:
    """Who answered in the light beside `theta`; None where that was not possible."""
    aimer = places.aimer
    steps = aimer.steps_at(beside(aimer.scanner, theta, places.target.p_cam, offset_m))
    if steps is None or (yield from turn_to(steps)):
        return None
    window = yield from lit(quick(aimer.rules))
    return None if window.failed else frozenset(window.heard)


def _hit(aimer: Aimer, outcome: Outcome, theta: Array, centre_m: Array) -> Hit:
    target = outcome.target
    return Hit(
        beside(aimer.scanner, theta, target.p_cam, centre_m),
        target.p_cam,
        target.cov_cam,
        SIGMA_THETA_RAD,
        sigma_middle_m(SPACING_M),
    )
