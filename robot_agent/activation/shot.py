"""A shot under a lease: search, prove, read, write. Drawn in docs/activation.md."""

from dataclasses import dataclass, replace
from itertools import chain

from robot_agent.activation.aimer import Aimer, Place, Places
from robot_agent.activation.commands import Act, Dark
from robot_agent.activation.doubt import p_false
from robot_agent.activation.memory import Work, at_the_tag
from robot_agent.activation.rules import ShotRules
from robot_agent.activation.sides import BOTH, sides
from robot_agent.activation.target import Target
from robot_agent.activation.verdict import Verdict, distance_m
from robot_agent.activation.window import Window, dark, light_up, turn_to
from robot_agent.laser.interlock import DeviceFailed


@dataclass(slots=True)
class _Shot:
    rules: ShotRules
    shots: int = 0


def shoot(aimer: Aimer, target: Target, work: Work) -> Act[Verdict]:
    """The laser is off when this returns. Any exception leaves that to the interlock."""
    places = aimer.places(target)
    if isinstance(places, str):
        return Verdict("refused", places)
    shot = _Shot(aimer.rules)
    verdict = yield from _search(shot, target, places, work)
    yield Dark()
    return replace(verdict, shots=shot.shots)


def _search(shot: _Shot, target: Target, places: Places, work: Work) -> Act[Verdict]:
    """Each place once, the likeliest again at the end, should its answers have been lost; the first
    that answers decides."""
    rules = shot.rules
    centre = next(iter(places), None)
    if centre is None or centre.p_beside > rules.most_p_false:
        return Verdict("ambiguous", "another spot is so near that the beam cannot tell them apart")
    for place in chain(places, (centre,)):
        if place.p_beside > rules.most_p_false:
            continue
        if why := (yield from turn_to(place.steps)):
            return Verdict("timeout" if isinstance(why, DeviceFailed) else "refused", why)
        window = yield from _look(shot)
        if window.failed:
            return Verdict("timeout", window.failed)
        if window.alone:
            return (yield from _prove(shot, places, place, window.alone, work))
        if window.often:
            return Verdict("ambiguous", f"{', '.join(sorted(window.heard))} answer at once")
    return silence(rules, target, shot.shots)


def silence(rules: ShotRules, target: Target, shots: int) -> Verdict:
    away_m = distance_m(target)
    said = f"nothing answers at {away_m:.1f} m, in {shots} windows"
    if away_m > rules.threshold_m:
        return Verdict("out_of_range", f"{said}; sure is only what is within {rules.threshold_m} m")
    return Verdict("false_match", said)


def _look(shot: _Shot) -> Act[Window]:
    window = yield from light_up(shot.rules)
    shot.shots += 1
    return window


def _prove(shot: _Shot, places: Places, place: Place, tag: str, work: Work) -> Act[Verdict]:
    """The tag follows the light: silent in the dark, and alone again in the light."""
    rules = shot.rules
    doubt = p_false(rules, places.target, tag, place.p_beside, places.is_sharp)
    if doubt > rules.most_p_false:
        return Verdict("ambiguous", f"{tag} answers, but its spots may be of two tags")
    window = yield from dark(rules)
    if window.failed:
        return Verdict("timeout", window.failed)
    if tag in window.heard:
        return Verdict("ambiguous", f"{tag} answers in the dark as well")
    seen = yield from sides(rules, places, place, tag)
    shot.shots += seen.shots
    if seen.failed:
        return Verdict("timeout", seen.failed)
    if seen.others:
        return Verdict("ambiguous", f"{tag} answered first, then {seen.others}")
    if not seen.lit:
        window = yield from _look(shot)
        if window.failed:
            return Verdict("timeout", window.failed)
        if window.alone != tag:
            then = ", ".join(sorted(window.heard)) or "nothing"
            return Verdict("ambiguous", f"{tag} answered first, then {then}")
    if places.is_sharp:
        across = yield from sides(rules, places, place, tag, across=True)
        shot.shots += across.shots
        if across.failed:
            return Verdict("timeout", across.failed)
        if across.lit < min(BOTH, across.shots) or across.others:
            return Verdict("ambiguous", f"{tag} is not on the ray of the left spot")
    said = "alone in the light, silent in the dark"
    return (yield from identified(rules, place, tag, doubt, said, seen.lit == BOTH, work))


def identified(
    rules: ShotRules, place: Place, tag: str, p_false: float, said: str, depth: bool, work: Work
) -> Act[Verdict]:
    """With what there is to do at the tag."""
    done = yield from at_the_tag(rules, tag, work)
    return Verdict(
        "identified",
        done.trouble or said,
        tag=tag,
        p_false=p_false,
        theta=place.theta,
        memory=done.memory,
        result=done.result,
        depth=depth,
    )
