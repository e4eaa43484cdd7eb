"""What the reader reports, as plain facts."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from robot_agent.rfid.llrp.codec import Message, name_of, part, parts
from robot_agent.rfid.llrp.requests import READ_OP, WRITE_OP

LONGEST_REMARK = 200
LONGEST_EPC_DIGITS = 124
"""31 words, the most that a protocol control word can tell of."""
TIMES = ("UTC", "Uptime")
"""A reader tells the time of day, or how long it has been up."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """One TagReportData. Times in us by the reader's clock, None where it does not say."""

    window: int | None
    epc: str
    count: int
    first_us: int | None
    last_us: int | None
    written: Message | None
    read: Message | None


@dataclass(frozen=True, slots=True)
class WindowEvent:
    """A window began or ended, at `t_us` by the reader's clock."""

    window: int
    ended: bool
    t_us: int | None


Fact: TypeAlias = Sighting | WindowEvent


def facts(message: Message, window: int) -> list[Fact]:
    """What a message says about one window; about other windows, nothing. So a tag that was
    heard in the last window and is reported late is never taken for one of this."""
    found: list[Fact] = []
    if name_of(message) == "RO_ACCESS_REPORT":
        found += _sightings(message)
    elif name_of(message) == "READER_EVENT_NOTIFICATION" and (event := _window_event(message)):
        found.append(event)
    return [fact for fact in found if fact.window == window]


def _sightings(report: Message) -> Iterator[Sighting]:
    for data in parts(report, "TagReportData"):
        epc = _epc(data)
        if epc:
            yield _sighting(data, epc)


def _window_event(notification: Message) -> WindowEvent | None:
    data = part(notification, "ReaderEventNotificationData")
    event = data and part(data, "ROSpecEvent")
    if not event or event.EventType not in (0, 1):
        return None
    return WindowEvent(event.ROSpecID, event.EventType == 1, _time(data, "{}Timestamp"))


def connection_status(message: Message) -> int | None:
    """0: this client is served; else why not. None: the message is about something else."""
    data = part(message, "ReaderEventNotificationData")
    event = data and part(data, "ConnectionAttemptEvent")
    return event.Status if event else None


def refusal(response: Message) -> str | None:
    """None: the reader did what it was asked."""
    status = part(response, "LLRPStatus")
    if status is None:
        return f"{name_of(response)} without a status"
    if status.StatusCode == 0:
        return None
    said = " ".join(status.ErrorDescription.split())[:LONGEST_REMARK]
    return f"{name_of(response)}: status {status.StatusCode} {said}".rstrip()


def _sighting(data: Message, epc: str) -> Sighting:
    count = _field(data, "TagSeenCount", "TagCount")
    return Sighting(
        window=_field(data, "ROSpecID", "ROSpecID"),
        epc=epc,
        count=1 if count is None else count,
        first_us=_time(data, "FirstSeenTimestamp{}"),
        last_us=_time(data, "LastSeenTimestamp{}"),
        written=_result(data, "C1G2WriteOpSpecResult", WRITE_OP),
        read=_result(data, "C1G2ReadOpSpecResult", READ_OP),
    )


def _epc(data: Message) -> str:
    """Empty for what cannot be the EPC of a tag: of no length, too long, or not in whole words."""
    short = part(data, "EPC_96")
    if short is not None:
        return f"{short.EPC:024x}"
    long = part(data, "EPCData")
    digits: str = long.EPC.hex() if long is not None else ""
    return digits if len(digits) <= LONGEST_EPC_DIGITS and len(digits) % 4 == 0 else ""


def _field(data: Message, name: str, field: str) -> int | None:
    found = part(data, name)
    return None if found is None else getattr(found, field)


def _time(data: Message, pattern: str) -> int | None:
    times = (_field(data, pattern.format(kind), "Microseconds") for kind in TIMES)
    return next((t for t in times if t is not None), None)


def _result(data: Message, name: str, operation: int) -> Message | None:
    return next((r for r in parts(data, name) if r.OpSpecID == operation), None)
