"""A shot without the service: the laser blinks a random code, and only what follows it counts."""

from dataclasses import dataclass, replace

import numpy as np

from robot_agent.activation.aimer import Aimer, Place, Places
from robot_agent.activation.commands import Act, Allow, Dark, Denied, Light, Listen, Wait
from robot_agent.activation.doubt import p_false
from robot_agent.activation.memory import Work
from robot_agent.activation.shot import identified, silence
from robot_agent.activation.sides import BOTH, sides
from robot_agent.activation.target import Target
from robot_agent.activation.verdict import Verdict
from robot_agent.activation.window import failure_of, turn_to
from robot_agent.laser.interlock import SECOND_NS, Permit
from robot_agent.rfid.reader import Inventory
from tagmap.arbitration.blink import Blink, BlinkRules, Reading

LEAD_S = 0.03
"""To turn the mirrors before the first slot."""
AFTER_S = 1.0
"""In steady light after a code that was followed: the depth, and the memory."""


@dataclass(frozen=True, slots=True)
class _Round:
    """`failed`: why there was none. `silent`: nothing was heard in too many slots of light."""

    readings: tuple[Reading, ...]
    now_ns: int
    silent: bool = False
    failed: str | None = None


def blink(
    aimer: Aimer,
    target: Target,
    work: Work,
    code_rules: BlinkRules,
    rng: np.random.Generator,
    now_ns: int,
) -> Act[Verdict]:
    """The laser is off when this returns."""
    places = aimer.places(target)
    if isinstance(places, str):
        return Verdict("refused", places)
    rules, shots = aimer.rules, 0
    first = next(iter(places), None)
    if first is None or first.p_beside > rules.most_p_false:
        return Verdict("ambiguous", "another spot is so near that the beam cannot tell them apart")
    for place in places:
        if place.p_beside > rules.most_p_false:
            continue
        code = Blink.draw(code_rules, rng, now_ns + round(LEAD_S * SECOND_NS))
        found = yield from _round(code, place)
        now_ns, shots = found.now_ns, shots + 1
        if found.failed:
            return Verdict("timeout", found.failed, shots)
        if not found.silent:
            verdict = yield from _judged(aimer, code, found, places, place, work)
            return replace(verdict, shots=shots)
    return silence(rules, target, shots)


def _round(code: Blink, place: Place) -> Act[_Round]:
    yield Allow(_permit(code), None)
    if why := (yield from turn_to(place.steps)):
        return _Round((), code.end_ns, failed=why)
    readings: list[Reading] = []
    unheard = 0
    for slot, on in enumerate(code.code):
        begin_ns = code.begin_ns + slot * code.rules.slot_ns
        heard = yield from _slot(code.rules, begin_ns, on)
        if isinstance(heard, str):
            reply = yield Dark()
            return _Round((), reply.now_ns, failed=heard)
        readings += heard
        unheard += on and not heard
        if unheard > code.rules.missed and not readings:
            reply = yield Dark()
            return _Round((), reply.now_ns, silent=True)
    reply = yield Dark()
    return _Round(tuple(readings), reply.now_ns)


def _permit(code: Blink) -> Permit:
    def permit(now_ns: int, for_s: float) -> bool:
        return code.is_on(now_ns) and code.is_on(now_ns + round(for_s * SECOND_NS))

    return permit


def _slot(rules: BlinkRules, begin_ns: int, on: bool) -> Act[list[Reading] | str]:
    """What was heard in the part of the slot that counts, or why it failed."""
    reply = yield Wait(begin_ns)
    end_ns = begin_ns + rules.slot_ns
    if on:
        reply = yield Light(max(0.0, (end_ns - reply.now_ns) / SECOND_NS - rules.guard_s / 2))
        if isinstance(reply.value, Denied):
            return reply.value.why
    else:
        yield Dark()
    listen_ns = begin_ns + round(rules.settle_s * SECOND_NS)
    yield Wait(listen_ns)
    reply = yield Listen(rules.listen_s)
    if not isinstance(reply.value, Inventory):
        return failure_of(reply.value)
    if reply.now_ns >= end_ns:
        return "the reader was late: its window ended in the next slot"
    return [Reading(tag.epc, listen_ns) for tag in reply.value.tags]


def _judged(
    aimer: Aimer, code: Blink, found: _Round, places: Places, place: Place, work: Work
) -> Act[Verdict]:
    judged = code.judge(found.readings)
    if judged.tag is None:
        return Verdict("ambiguous", judged.reason or "nothing follows the code")
    doubt = judged.p_false + p_false(
        aimer.rules, places.target, judged.tag, place.p_beside, sides=False
    )
    if doubt > aimer.rules.most_p_false:
        return Verdict("ambiguous", f"{judged.tag} is another with probability {doubt:.1g}")
    end_ns = found.now_ns + round(AFTER_S * SECOND_NS)
    yield Allow(lambda now_ns, s: now_ns + round(s * SECOND_NS) <= end_ns, None)
    seen = yield from sides(aimer.rules, places, place, judged.tag)
    if seen.failed or seen.others:
        # The code has proved whose tag it is; what disturbs now leaves the depth open.
        seen = replace(seen, lit=0)
        yield from turn_to(place.steps)
    depth = seen.lit == BOTH
    verdict = yield from identified(
        aimer.rules, place, judged.tag, doubt, "follows the code", depth, work
    )
    yield Dark()
    return verdict
