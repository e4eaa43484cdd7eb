"""One turn of a robot: leave to shoot, as many shots as it lasts, and giving it back."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from robot_agent.activation.aimer import Aimer
from robot_agent.activation.blinking import blink
from robot_agent.activation.commands import Act, Allow, Answered, Ask, Denied, Listen, Rest, Wait
from robot_agent.activation.learning import learn, probe, probe_s, with_lesson
from robot_agent.activation.memory import Work
from robot_agent.activation.shot import shoot
from robot_agent.activation.target import Target
from robot_agent.activation.verdict import Outcome, Verdict
from robot_agent.calibration.scanner.online import Online
from robot_agent.laser.interlock import SECOND_NS
from robot_agent.rfid.reader import Inventory
from tagmap.arbitration.blink import BlinkRules
from tagmap.arbitration.holder import Holder
from tagmap.arbitration.listening import Listening

Choose: TypeAlias = Callable[[Sequence[Outcome]], Target | None]
"""The next target after these outcomes of the turn; None: enough."""

PROBING = 1.1
"""Times the light of probing: the mirrors turn in between."""


@dataclass(slots=True)
class Shooter:
    """What lasts from turn to turn.

    done         a lease to give back with the next question
    online       the scanner as hits refine it, None: it stays as it was calibrated
    probe_every  so many identified tags one is probed, where the lease has time for it
    warning      of a mount that has turned; None: of nothing
    """

    aimer: Aimer
    holder: Holder
    rng: np.random.Generator
    blink: BlinkRules = field(default_factory=BlinkRules)
    listening: Listening | None = None
    done: int | None = None
    online: Online | None = None
    probe_every: int = 10
    warning: str | None = None
    identified: int = 0


def turn(shooter: Shooter, choose: Choose, work: Work, now_ns: int) -> Act[list[Outcome]]:
    """Empty where there was no leave to shoot, nothing to shoot at, or the laser was on for so long
    that it would not last. Call it again: it always asks the service, and while that is silent,
    `Holder.is_alone`, it listens and blinks."""
    first = choose([])
    if first is None or not (yield from _is_rested(shooter)):
        return []
    try:
        outcomes = yield from _leased(shooter, choose, work)
    finally:
        if shooter.holder.lease is not None:
            # An exception: the interlock has the laser off.
            shooter.done = shooter.holder.finish(now_ns)
    reply = yield Wait(now_ns)
    if shooter.holder.is_alone(reply.now_ns):
        return (yield from _alone(shooter, first, work, reply.now_ns))
    return outcomes


def _leased(shooter: Shooter, choose: Choose, work: Work) -> Act[list[Outcome]]:
    holder, rules = shooter.holder, shooter.aimer.rules
    reply = yield Wait(holder.ask_at_ns)
    if not holder.may_ask(reply.now_ns):
        return []
    ticket = holder.ask(reply.now_ns)
    reply = yield Ask(holder.rules.max_lease_s, shooter.done, rules.ask_s)
    assert isinstance(reply.value, Answered)
    if reply.value.reply is None:
        holder.give_up(reply.now_ns)
        return []
    shooter.done, shooter.listening = None, None
    told = reply.value.reply
    holder.take(ticket, told.lease, told.valid_s, told.retry_s, reply.now_ns)
    if not holder.may_shoot(reply.now_ns, rules.proof_s):
        if holder.lease is not None:
            yield from _give_back(shooter, reply.now_ns)
        return []
    yield Allow(holder.may_shoot, reply.value.mark)
    outcomes = yield from _shots(shooter, choose, work, reply.now_ns)
    yield from _give_back(shooter, reply.now_ns)
    return outcomes


def _shots(shooter: Shooter, choose: Choose, work: Work, now_ns: int) -> Act[list[Outcome]]:
    """As long as there is time to prove one more."""
    outcomes: list[Outcome] = []
    lease = shooter.holder.lease
    while shooter.holder.may_shoot(now_ns, shooter.aimer.rules.proof_s):
        target = choose(outcomes)
        if target is None:
            break
        verdict = yield from shoot(shooter.aimer, target, work)
        reply = yield Wait(now_ns)
        outcomes.append(Outcome(target, verdict, lease, now_ns, reply.now_ns))
        now_ns = yield from _learn(shooter, outcomes[-1])
        if not (yield from _is_rested(shooter)):
            break
    return outcomes


def _is_rested(shooter: Shooter) -> Act[bool]:
    """Whether the light would last for one more tag, its record and all."""
    rules = shooter.aimer.rules
    reply = yield Rest(rules.proof_s + rules.write_s)
    return not isinstance(reply.value, Denied)


def _learn(shooter: Shooter, outcome: Outcome) -> Act[int]:
    """Now and then, from a tag that was lit; when it is over."""
    now_ns = outcome.ended_ns
    if shooter.online is None or not shooter.probe_every or not outcome.verdict.depth:
        return now_ns
    shooter.identified += 1
    probing_s = PROBING * probe_s(shooter.aimer.rules)
    if shooter.identified < shooter.probe_every or not shooter.holder.may_shoot(now_ns, probing_s):
        return now_ns
    shooter.identified = 0
    hit = yield from probe(shooter.aimer, outcome)
    if hit is not None:
        lesson = learn(shooter.online, hit, outcome)
        shooter.online, shooter.warning = lesson.online, lesson.warning
        shooter.aimer = with_lesson(shooter.aimer, lesson)
    reply = yield Wait(now_ns)
    return reply.now_ns


def _give_back(shooter: Shooter, now_ns: int) -> Act[None]:
    yield Allow(None)
    done = shooter.done = shooter.holder.finish(now_ns)
    reply = yield Ask(0.0, done, shooter.aimer.rules.ask_s)
    if isinstance(reply.value, Answered) and reply.value.reply is not None:
        shooter.done = None


def _alone(shooter: Shooter, target: Target, work: Work, now_ns: int) -> Act[list[Outcome]]:
    """Listen; one blinking shot when it has been quiet, else nothing yet."""
    listening = shooter.listening = shooter.listening or Listening.start(now_ns)
    rules, began_ns = shooter.aimer.rules, now_ns
    while not listening.may_begin(now_ns):
        if now_ns - began_ns > SECOND_NS:
            return []
        reply = yield Listen(rules.window_s)
        now_ns = reply.now_ns
        if isinstance(reply.value, Inventory) and reply.value.tags:
            listening.heard(now_ns, shooter.rng)
    began_ns = now_ns
    verdict: Verdict = yield from blink(
        shooter.aimer, target, work, shooter.blink, shooter.rng, now_ns
    )
    reply = yield Allow(None)
    listening.end_turn(reply.now_ns, shooter.rng)
    return [Outcome(target, verdict, None, began_ns, reply.now_ns)]
