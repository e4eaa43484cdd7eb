"""One window: laser on, who answers, laser off."""

from collections.abc import Mapping
from dataclasses import dataclass

from robot_agent.activation.commands import Act, Aim, Dark, Denied, Light, Listen, Wait
from robot_agent.activation.rules import ShotRules
from robot_agent.laser.device import Steps
from robot_agent.laser.interlock import SECOND_NS, DeviceFailed
from robot_agent.rfid.reader import Inventory


@dataclass(frozen=True, slots=True)
class Window:
    """`heard`: how often each tag answered; empty also where `failed` says why there was none."""

    heard: Mapping[str, int]
    failed: str | None = None

    @property
    def often(self) -> list[str]:
        """What was heard more than once, be it in several tries: the rest may be no tags."""
        return sorted(tag for tag, count in self.heard.items() if count > 1)

    @property
    def alone(self) -> str | None:
        """The one tag that answered, and more than once."""
        if len(self.heard) != 1:
            return None
        ((tag, count),) = self.heard.items()
        return tag if count > 1 else None


def turn_to(steps: Steps) -> Act[str | None]:
    """Why the mirrors were not turned, None: they were."""
    reply = yield Aim(steps)
    return reply.value.why if isinstance(reply.value, Denied) else None


def lit(rules: ShotRules) -> Act[Window]:
    """What answers in the light. The laser is on afterwards, for `margin_s` at the most."""
    reply = yield Wait(0)
    until_ns = reply.now_ns + round(rules.shot_s * SECOND_NS)
    reply = yield Light(rules.shot_s)
    if isinstance(reply.value, Denied):
        return Window({}, reply.value.why)
    return (yield from heard(rules, reply.now_ns, until_ns))


def dark(rules: ShotRules) -> Act[Window]:
    """What answers in the dark."""
    reply = yield Dark()
    return (yield from heard(rules, reply.now_ns, None))


def heard(rules: ShotRules, now_ns: int, until_ns: int | None) -> Act[Window]:
    yield Wait(now_ns + round(rules.settle_s * SECOND_NS))
    reply = yield Listen(rules.window_s)
    if not isinstance(reply.value, Inventory):
        return Window({}, failure_of(reply.value))
    if until_ns is not None and reply.now_ns > until_ns:
        return Window({}, "the reader was late: the laser may have been off already")
    return Window({tag.epc: tag.count for tag in reply.value.tags})


def failure_of(value: object) -> DeviceFailed:
    """What a reader says that did not listen."""
    return DeviceFailed(getattr(value, "detail", "the reader did not answer"))


def light_up(rules: ShotRules) -> Act[Window]:
    """`lit`, again while more than one tag answers, or one only once. Still so after all tries:
    the last window, with all that was heard in any of them."""
    seen: dict[str, int] = {}
    for _ in range(rules.tries):
        window = yield from lit(rules)
        if window.failed or window.alone or not window.heard:
            return window
        for tag, count in window.heard.items():
            seen[tag] = seen.get(tag, 0) + count
    return Window(seen)
