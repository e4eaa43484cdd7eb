"""Answers and notifications, built from plain facts."""

from collections.abc import Sequence
from typing import Literal, TypeAlias

from robot_agent.rfid.llrp.codec import Message, llrp

Status: TypeAlias = Literal[
    "M_Success",
    "M_ParameterError",
    "M_FieldError",
    "M_MissingParameter",
    "M_OverflowParameter",
    "M_UnsupportedMessage",
    "P_UnsupportedParameter",
    "A_Invalid",
]
CONNECTED, OCCUPIED = 0, 2
"""ConnectionAttemptStatusType: served, or another client is."""


def answer(
    request: Message, status: Status = "M_Success", why: str = "", more: Sequence[Message] = ()
) -> Message:
    made = llrp().GetResponseClass(request)
    parameters = [_status(status, why), *more]
    return made(MessageID=request.MessageID, Parameters=parameters)


def error(id: int, status: Status, why: str) -> Message:
    return llrp().ERROR_MESSAGE_Message(MessageID=id, Parameters=[_status(status, why)])


def greeting(status: int, t_ns: int) -> Message:
    return _notification(llrp().ConnectionAttemptEvent_Parameter(status), t_ns)


def ro_spec_event(id: int, ended: bool, t_ns: int) -> Message:
    event = llrp().ROSpecEvent_Parameter(EventType=int(ended), ROSpecID=id)
    return _notification(event, t_ns)


def _notification(event: Message, t_ns: int) -> Message:
    p = llrp()
    data = p.ReaderEventNotificationData_Parameter(
        Parameters=[p.UTCTimestamp_Parameter(t_ns // 1000), event]
    )
    return p.READER_EVENT_NOTIFICATION_Message(Parameters=[data])


def _status(status: Status, why: str) -> Message:
    p = llrp()
    return p.LLRPStatus_Parameter(
        StatusCode=getattr(p.StatusCode, status), ErrorDescription=why[:500]
    )
