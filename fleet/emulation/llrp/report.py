"""What was heard, gathered until the client wants to know."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from robot_agent.rfid.llrp.codec import Message, llrp, part

NEVER, AT_END_OF_ANTENNA_SPEC, AT_END = range(3)
"""ROReportTriggerType. With N > 0 also whenever N tags have been heard."""
SHORT_EPC_DIGITS = 24
ANTENNA = 1


@dataclass(slots=True)
class _Entry:
    epc: str
    first_ns: int
    last_ns: int
    count: int = 1
    access: int | None = None
    results: Sequence[Message] = ()


@dataclass(slots=True)
class Report:
    """Of one ROSpec. `spec` is its ROReportSpec; None: everything, at the end."""

    ro_spec: int
    spec: Message | None
    ready: list[Message] = field(default_factory=list)
    _entries: list[_Entry] = field(default_factory=list)

    def heard(self, epc: str, t_ns: int) -> None:
        known = next((e for e in self._entries if e.epc == epc and e.access is None), None)
        if known is None:
            self._entries.append(_Entry(epc, t_ns, t_ns))
        else:
            known.count += 1
            known.last_ns = t_ns
        if self.spec is not None and 0 < self.spec.N <= len(self._entries):
            self.send()

    def obeyed(self, epc: str, t_ns: int, access: int, results: Sequence[Message]) -> None:
        self._entries.append(_Entry(epc, t_ns, t_ns, 1, access, results))

    def ended(self, trigger: int) -> None:
        wanted = AT_END if self.spec is None else self.spec.ROReportTrigger
        if wanted == trigger or (trigger == AT_END and wanted == AT_END_OF_ANTENNA_SPEC):
            self.send()

    def send(self) -> None:
        """Make a message of what there is, for whoever collects `ready`."""
        if self._entries:
            data = [self._tag(entry) for entry in self._entries]
            self.ready.append(llrp().RO_ACCESS_REPORT_Message(Parameters=data))
            self._entries.clear()

    def _tag(self, entry: _Entry) -> Message:
        p = llrp()
        optional = {
            "EnableROSpecID": p.ROSpecID_Parameter(self.ro_spec),
            "EnableAntennaID": p.AntennaID_Parameter(ANTENNA),
            "EnableFirstSeenTimestamp": p.FirstSeenTimestampUTC_Parameter(entry.first_ns // 1000),
            "EnableLastSeenTimestamp": p.LastSeenTimestampUTC_Parameter(entry.last_ns // 1000),
            "EnableTagSeenCount": p.TagSeenCount_Parameter(min(entry.count, 0xFFFF)),
        }
        content = self.spec and part(self.spec, "TagReportContentSelector")
        parameters = [_epc(entry.epc)]
        parameters += [p for name, p in optional.items() if not content or getattr(content, name)]
        if entry.access is not None and (not content or content.EnableAccessSpecID):
            parameters.append(p.AccessSpecID_Parameter(entry.access))
        return p.TagReportData_Parameter(Parameters=[*parameters, *entry.results])


def _epc(epc: str) -> Message:
    if len(epc) == SHORT_EPC_DIGITS:
        return llrp().EPC_96_Parameter(int(epc, 16))
    return llrp().EPCData_Parameter(bytes.fromhex(epc))
