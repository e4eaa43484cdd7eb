"""The messages that the driver sends, built from plain numbers."""

from collections.abc import Sequence
from typing import Any

from robot_agent.rfid.llrp.codec import Message, llrp

EPC_BANK, USER_BANK = 1, 3
LENGTH_STARTS_AT_BIT, LENGTH_MASK, LENGTH_SHIFT = 16, 0xF8, 3
"""The first five bits of the protocol control word: words of the EPC."""
EPC_STARTS_AT_BIT = 32
WRITE_OP, READ_OP = 1, 2
LONGEST_MS = (1 << 32) - 1
AIR = 1
"""EPCglobal Class 1 Gen 2."""


def configure(keepalive_s: float) -> Message:
    """Keepalives, and word of every window that begins or ends."""
    p = llrp()
    events = p.EventNotificationState_Parameter(
        EventType=p.NotificationEventType.ROSpec_Event, NotificationState=True
    )
    return p.SET_READER_CONFIG_Message(
        ResetToFactoryDefault=False,
        Parameters=[
            p.ReaderEventNotificationSpec_Parameter(Parameters=[events]),
            p.KeepaliveSpec_Parameter(
                KeepaliveTriggerType=p.KeepaliveTriggerType.Periodic,
                PeriodicTriggerValue=round(keepalive_s * 1e3),
            ),
        ],
    )


def forget_everything() -> list[Message]:
    """The end of every window and command, also of those that a killed agent left in the reader,
    which first sends what it has heard. Id 0 means all."""
    p = llrp()
    return [
        p.DELETE_ACCESSSPEC_Message(AccessSpecID=0),
        p.DELETE_ROSPEC_Message(ROSpecID=0),
    ]


def open_window(id: int, window_s: float, antennas: Sequence[int]) -> list[Message]:
    """A window that begins when the last of these is obeyed, and that the reader itself ends."""
    p = llrp()
    return [
        p.ADD_ROSPEC_Message(Parameters=[_window(id, window_s, antennas)]),
        p.ENABLE_ROSPEC_Message(ROSpecID=id),
        p.START_ROSPEC_Message(ROSpecID=id),
    ]


def prepare_access(id: int, window: int, epc: str, commands: Sequence[Message]) -> list[Message]:
    """Commands to the first tag of exactly this EPC that answers in the window, once."""
    p = llrp()
    spec = p.AccessSpec_Parameter(
        AccessSpecID=id,
        ProtocolID=AIR,
        CurrentState=False,
        ROSpecID=window,
        Parameters=[
            p.AccessSpecStopTrigger_Parameter(
                AccessSpecStopTrigger=p.AccessSpecStopTriggerType.Operation_Count,
                OperationCountValue=1,
            ),
            p.AccessCommand_Parameter(
                Parameters=[p.C1G2TagSpec_Parameter(Parameters=_exactly(epc)), *commands]
            ),
            p.AccessReportSpec_Parameter(
                AccessReportTrigger=p.AccessReportTriggerType.End_Of_AccessSpec
            ),
        ],
    )
    return [
        p.ADD_ACCESSSPEC_Message(Parameters=[spec]),
        p.ENABLE_ACCESSSPEC_Message(AccessSpecID=id),
    ]


def read_command(start: int, count: int) -> Message:
    """`count` 0: all up to the end of user memory."""
    return llrp().C1G2Read_Parameter(
        OpSpecID=READ_OP, MB=USER_BANK, WordPointer=start, WordCount=count
    )


def write_command(start: int, words: Sequence[int]) -> Message:
    return llrp().C1G2Write_Parameter(
        OpSpecID=WRITE_OP, MB=USER_BANK, WordPointer=start, WriteData=list(words)
    )


def ask_capabilities() -> Message:
    p = llrp()
    kind = p.GetReaderCapabilitiesRequestedData.General_Device_Capabilities
    return p.GET_READER_CAPABILITIES_Message(RequestedData=kind)


def _exactly(epc: str) -> list[Message]:
    """Two patterns, which must both agree: a longer EPC may begin as this one does."""
    digits = bytes.fromhex(epc)
    length = (len(digits) // 2) << LENGTH_SHIFT
    return [
        _pattern(EPC_STARTS_AT_BIT, b"\xff" * len(digits), digits),
        _pattern(LENGTH_STARTS_AT_BIT, bytes([LENGTH_MASK]), bytes([length])),
    ]


def _pattern(bit: int, mask: bytes, data: bytes) -> Message:
    return llrp().C1G2TargetTag_Parameter(
        MB=EPC_BANK, Match=True, Pointer=bit, TagMask=mask, TagData=data
    )


def _window(id: int, window_s: float, antennas: Sequence[int]) -> Any:
    p = llrp()
    boundary = p.ROBoundarySpec_Parameter(
        Parameters=[
            p.ROSpecStartTrigger_Parameter(ROSpecStartTriggerType=p.ROSpecStartTriggerType.Null),
            p.ROSpecStopTrigger_Parameter(
                ROSpecStopTriggerType=p.ROSpecStopTriggerType.Duration,
                DurationTriggerValue=min(max(1, round(window_s * 1e3)), LONGEST_MS),
            ),
        ]
    )
    listening = p.AISpec_Parameter(
        AntennaIDs=list(antennas),
        Parameters=[
            p.AISpecStopTrigger_Parameter(AISpecStopTriggerType=p.AISpecStopTriggerType.Null),
            p.InventoryParameterSpec_Parameter(InventoryParameterSpecID=1, ProtocolID=AIR),
        ],
    )
    return p.ROSpec_Parameter(
        ROSpecID=id,
        CurrentState=p.ROSpecState.Disabled,
        Parameters=[boundary, listening, _report_each_tag()],
    )


def _report_each_tag() -> Any:
    p = llrp()
    content = p.TagReportContentSelector_Parameter(
        EnableROSpecID=True,
        EnableFirstSeenTimestamp=True,
        EnableLastSeenTimestamp=True,
        EnableTagSeenCount=True,
        EnableAccessSpecID=True,
    )
    return p.ROReportSpec_Parameter(
        ROReportTrigger=p.ROReportTriggerType.Upon_N_Tags_Or_End_Of_ROSpec,
        N=1,
        Parameters=[content],
    )
