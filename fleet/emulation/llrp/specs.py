"""What a client told the reader to do, and what of that it can do."""

from dataclasses import dataclass
from enum import Enum
from typing import Any

from robot_agent.rfid.llrp.codec import Message, llrp, name_of, part, parts

MS = 1_000_000
COMMANDS = ("C1G2Read", "C1G2Write")


class State(Enum):
    DISABLED, INACTIVE, ACTIVE = range(3)


class Unsupported(Exception):
    """The specification allows it, this reader does not. Says what."""


class Incomplete(Exception):
    """Something is missing that the specification demands. Says what."""


@dataclass(slots=True)
class RoSpec:
    """When to listen, and when to report what was heard."""

    id: int
    definition: Message
    state: State = State.DISABLED

    def shown(self) -> Message:
        """As GET_ROSPECS tells."""
        self.definition.CurrentState = self.state.value
        return self.definition

    @property
    def starts_at_once(self) -> bool:
        trigger = must(self.definition, "ROBoundarySpec", "ROSpecStartTrigger")
        return bool(trigger.ROSpecStartTriggerType == 1)

    @property
    def duration_ns(self) -> int | None:
        trigger = must(self.definition, "ROBoundarySpec", "ROSpecStopTrigger")
        return _duration_ns(trigger.ROSpecStopTriggerType == 1, trigger.DurationTriggerValue)

    @property
    def antenna_specs(self) -> list["AiSpec"]:
        return [_ai_spec(spec) for spec in parts(self.definition, "AISpec")]

    @property
    def report_spec(self) -> Message | None:
        return part(self.definition, "ROReportSpec")


@dataclass(frozen=True, slots=True)
class AiSpec:
    """One stretch of listening, and when it is over; None: not by that."""

    duration_ns: int | None = None
    tags: int | None = None
    silence_ns: int | None = None
    rounds: int | None = None


@dataclass(slots=True)
class AccessSpec:
    """Commands for the tags that match; `left` is how often still, None: for ever."""

    id: int
    definition: Message
    left: int | None
    enabled: bool = False

    def shown(self) -> Message:
        """As GET_ACCESSSPECS tells."""
        self.definition.CurrentState = self.enabled
        return self.definition

    @property
    def ro_spec_id(self) -> int:
        """0 is any."""
        return int(self.definition.ROSpecID)

    @property
    def commands(self) -> list[Message]:
        inner = must(self.definition, "AccessCommand").Parameters
        return [command for command in inner if name_of(command) in COMMANDS]

    @property
    def targets(self) -> list[Message]:
        return list(
            parts(part(part(self.definition, "AccessCommand"), "C1G2TagSpec"), "C1G2TargetTag")
        )

    @property
    def reports_at_once(self) -> bool:
        spec = part(self.definition, "AccessReportSpec")
        return spec is not None and bool(spec.AccessReportTrigger == 1)


def ro_spec(definition: Message) -> RoSpec:
    """Raises Unsupported and Incomplete."""
    spec = RoSpec(definition.ROSpecID, definition)
    for inner in definition.Parameters:
        if name_of(inner) not in ("ROBoundarySpec", "AISpec", "ROReportSpec"):
            raise Unsupported(f"{name_of(inner)} in a ROSpec")
    boundary = must(definition, "ROBoundarySpec")
    if must(boundary, "ROSpecStartTrigger").ROSpecStartTriggerType not in (0, 1):
        raise Unsupported("a start trigger other than null or immediate")
    if must(boundary, "ROSpecStopTrigger").ROSpecStopTriggerType not in (0, 1):
        raise Unsupported("a stop trigger other than null or duration")
    for listening in parts(definition, "AISpec"):
        if listening.getFirstParameterByClass(llrp().C1G2Filter_Parameter) is not None:
            raise Unsupported("a C1G2Filter: this reader selects nothing before it listens")
    if not spec.antenna_specs:
        raise Unsupported("a ROSpec without an AISpec")
    return spec


def access_spec(definition: Message) -> AccessSpec:
    """Raises Unsupported and Incomplete."""
    for inner in must(definition, "AccessCommand").Parameters:
        if name_of(inner) not in ("C1G2TagSpec", *COMMANDS):
            raise Unsupported(f"{name_of(inner)} in an AccessSpec")
    trigger = must(definition, "AccessSpecStopTrigger")
    count = trigger.OperationCountValue if trigger.AccessSpecStopTrigger == 1 else 0
    spec = AccessSpec(definition.AccessSpecID, definition, count or None)
    if not spec.targets or not spec.commands:
        raise Unsupported("an AccessSpec without target or command")
    return spec


def must(message: Message, *path: str) -> Message:
    """The parameter at the end of the path. Raises Incomplete."""
    for name in path:
        message = part(message, name)
        if message is None:
            raise Incomplete(f"no {name}")
    return message


def _ai_spec(definition: Any) -> AiSpec:
    trigger = must(definition, "AISpecStopTrigger")
    kind = trigger.AISpecStopTriggerType
    if kind == 1:
        return AiSpec(duration_ns=trigger.DurationTrigger * MS)
    if kind == 3:
        return _observation(must(trigger, "TagObservationTrigger"))
    if kind == 0:
        return AiSpec()
    raise Unsupported("an AISpec that a general purpose input ends")


def _observation(trigger: Any) -> AiSpec:
    timeout = _duration_ns(trigger.Timeout > 0, trigger.Timeout)
    if trigger.TriggerType == 0:
        return AiSpec(timeout, tags=trigger.NumberOfTags)
    if trigger.TriggerType == 1:
        return AiSpec(timeout, silence_ns=trigger.T * MS)
    if trigger.TriggerType == 2:
        return AiSpec(timeout, rounds=trigger.NumberOfAttempts)
    raise Unsupported(f"a tag observation trigger of type {trigger.TriggerType}")


def _duration_ns(given: bool, value_ms: int) -> int | None:
    return value_ms * MS if given else None
