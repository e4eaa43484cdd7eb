"""Lit from both sides: the proof that a tag is as far away as its match of spots says.

A tag at another depth on the same ray of the left camera is lit as well, for the laser is beside
that camera; but it lies to one side of the beam.
"""

from dataclasses import dataclass

from robot_agent.activation.aimer import Place, Places
from robot_agent.activation.commands import Act
from robot_agent.activation.rules import ShotRules
from robot_agent.activation.window import light_up, turn_to

BOTH = 2


@dataclass(frozen=True, slots=True)
class Sides:
    """
    lit      sides from which the tag answered, and no other
    shots    windows that this took
    others   other tags that answered, as text; empty: none did
    failed   why it could not be tried
    """

    lit: int
    shots: int
    others: str = ""
    failed: str | None = None


def sides(
    rules: ShotRules, places: Places, place: Place, tag: str, across: bool = False
) -> Act[Sides]:
    """The mirrors stand at the place again afterwards, in the dark."""
    lit = shots = 0
    for side in places.abreast(place, across):
        if (yield from turn_to(side.steps)):
            # Beyond the sector: that side proves nothing.
            continue
        window = yield from light_up(rules)
        shots += 1
        others = ", ".join(sorted(other for other in window.often if other != tag))
        if window.failed or others:
            return Sides(lit, shots, others, window.failed)
        lit += window.alone == tag
    return Sides(lit, shots, failed=(yield from turn_to(place.steps)))
