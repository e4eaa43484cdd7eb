"""The reader without its socket: messages in, messages out, time passed in."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

from fleet.emulation.llrp.capabilities import MOST_SPECS, capabilities
from fleet.emulation.llrp.inventory import Listening
from fleet.emulation.llrp.replies import CONNECTED, Status, answer, error, greeting, ro_spec_event
from fleet.emulation.llrp.report import AT_END, Report
from fleet.emulation.llrp.specs import (
    MS,
    AccessSpec,
    Incomplete,
    RoSpec,
    State,
    Unsupported,
    access_spec,
    must,
    ro_spec,
)
from fleet.simulation.scene.antenna import Antenna
from robot_agent.rfid.llrp.codec import Message, llrp, name_of, part, parts

Spec = TypeVar("Spec", RoSpec, AccessSpec)
Obey: TypeAlias = Callable[[Message, int], Sequence[Message]]
"""A request and the time to the parameters of the answer."""

ALL = 0
RO_SPEC_EVENTS = 2
NEEDS_NO_ANSWER = ("KEEPALIVE_ACK", "ENABLE_EVENTS_AND_REPORTS")
SHORTEST_KEEPALIVE_NS = 10 * MS


class _Denied(Exception):
    def __init__(self, status: Status, why: str) -> None:
        super().__init__(why)
        self.status = status


class EmulatedReader:
    """An LLRP 1.0.1 reader with one antenna. As real ones do, it keeps what it was told to do
    when its client goes away, and goes on doing it."""

    def __init__(self, antenna: Antenna) -> None:
        self._antenna = antenna
        self._ro_specs: dict[int, RoSpec] = {}
        self._access: dict[int, AccessSpec] = {}
        self._active: Active | None = None
        self._wake_ns = 0
        self._keepalive_ns: int | None = None
        self._next_keepalive_ns = 0
        self._report_spec: Message | None = None
        self._tells_events = False
        self._out: list[Message] = []
        self._obeyed: dict[str, Obey] = {
            "ADD_ROSPEC": self._add_ro_spec,
            "DELETE_ROSPEC": self._delete_ro_spec,
            "ENABLE_ROSPEC": self._enable_ro_spec,
            "DISABLE_ROSPEC": self._disable_ro_spec,
            "START_ROSPEC": self._start_ro_spec,
            "STOP_ROSPEC": self._stop_ro_spec,
            "GET_ROSPECS": lambda *_: [spec.shown() for spec in self._ro_specs.values()],
            "ADD_ACCESSSPEC": self._add_access,
            "DELETE_ACCESSSPEC": self._delete_access,
            "ENABLE_ACCESSSPEC": self._enable_access,
            "DISABLE_ACCESSSPEC": self._disable_access,
            "GET_ACCESSSPECS": lambda *_: [spec.shown() for spec in self._access.values()],
            "GET_READER_CAPABILITIES": lambda request, _: capabilities(request.RequestedData),
            "GET_READER_CONFIG": lambda *_: [],
            "SET_READER_CONFIG": self._configure,
            "CLOSE_CONNECTION": lambda *_: [],
        }

    def connected(self, t_ns: int) -> list[Message]:
        """A client is there; what an earlier one did not collect is not for this one."""
        self._out.clear()
        self._next_keepalive_ns = t_ns + (self._keepalive_ns or 0)
        return [greeting(CONNECTED, t_ns)]

    def receive(self, message: Message, t_ns: int) -> list[Message]:
        """Obey or refuse, and say which."""
        name = name_of(message)
        if name == "GET_REPORT":
            self._report_now()
        elif name in self._obeyed:
            self._out.append(self._answer(message, self._obeyed[name], t_ns))
        elif name not in NEEDS_NO_ANSWER:
            self._out.append(error(message.MessageID, "M_UnsupportedMessage", f"no {name} here"))
        return self._take()

    def due_ns(self) -> int | None:
        """When `tick` wants to be called next; None: nothing is going on."""
        times = [self._wake_ns] if self._active else []
        times += [self._next_keepalive_ns] if self._keepalive_ns else []
        return min(times, default=None)

    def tick(self, t_ns: int) -> list[Message]:
        """Do what is due."""
        if self._keepalive_ns and t_ns >= self._next_keepalive_ns:
            self._out.append(llrp().KEEPALIVE_Message())
            self._next_keepalive_ns = t_ns + self._keepalive_ns
        if self._active and t_ns >= self._wake_ns:
            self._go_on(self._active, t_ns)
        return self._take()

    def _take(self) -> list[Message]:
        taken, self._out = self._out, []
        return taken

    def _answer(self, request: Message, obey: Obey, t_ns: int) -> Message:
        try:
            return answer(request, more=obey(request, t_ns))
        except _Denied as denied:
            return answer(request, denied.status, str(denied))
        except Unsupported as refused:
            return answer(request, "P_UnsupportedParameter", str(refused))
        except Incomplete as missing:
            return answer(request, "M_MissingParameter", str(missing))

    def _add_ro_spec(self, request: Message, _t_ns: int) -> Sequence[Message]:
        _add(self._ro_specs, ro_spec(must(request, "ROSpec")))
        return ()

    def _delete_ro_spec(self, request: Message, t_ns: int) -> Sequence[Message]:
        for spec in _chosen(self._ro_specs, request.ROSpecID):
            self._end(spec, t_ns)
            del self._ro_specs[spec.id]
        return ()

    def _enable_ro_spec(self, request: Message, t_ns: int) -> Sequence[Message]:
        for spec in _chosen(self._ro_specs, request.ROSpecID):
            if spec.state == State.DISABLED:
                spec.state = State.INACTIVE
        self._start_what_starts_at_once(t_ns)
        return ()

    def _disable_ro_spec(self, request: Message, t_ns: int) -> Sequence[Message]:
        for spec in _chosen(self._ro_specs, request.ROSpecID):
            self._end(spec, t_ns)
            spec.state = State.DISABLED
        return ()

    def _start_ro_spec(self, request: Message, t_ns: int) -> Sequence[Message]:
        chosen = _chosen(self._ro_specs, request.ROSpecID)
        if len(chosen) != 1 or chosen[0].state == State.DISABLED or self._active:
            raise _Denied("A_Invalid", f"ROSpec {request.ROSpecID} cannot start now")
        self._start(chosen[0], t_ns)
        return ()

    def _stop_ro_spec(self, request: Message, t_ns: int) -> Sequence[Message]:
        for spec in _chosen(self._ro_specs, request.ROSpecID):
            self._end(spec, t_ns)
        return ()

    def _add_access(self, request: Message, _t_ns: int) -> Sequence[Message]:
        _add(self._access, access_spec(must(request, "AccessSpec")))
        return ()

    def _delete_access(self, request: Message, _t_ns: int) -> Sequence[Message]:
        for spec in _chosen(self._access, request.AccessSpecID):
            del self._access[spec.id]
        return ()

    def _enable_access(self, request: Message, _t_ns: int) -> Sequence[Message]:
        for spec in _chosen(self._access, request.AccessSpecID):
            spec.enabled = True
        return ()

    def _disable_access(self, request: Message, _t_ns: int) -> Sequence[Message]:
        for spec in _chosen(self._access, request.AccessSpecID):
            spec.enabled = False
        return ()

    def _configure(self, request: Message, t_ns: int) -> Sequence[Message]:
        if request.ResetToFactoryDefault:
            self._keepalive_ns, self._report_spec, self._tells_events = None, None, False
        keepalive = part(request, "KeepaliveSpec")
        if keepalive is not None:
            period_ns = keepalive.PeriodicTriggerValue * MS
            periodic = keepalive.KeepaliveTriggerType == 1
            self._keepalive_ns = max(period_ns, SHORTEST_KEEPALIVE_NS) if periodic else None
            self._next_keepalive_ns = t_ns + (self._keepalive_ns or 0)
        self._report_spec = part(request, "ROReportSpec") or self._report_spec
        events = part(request, "ReaderEventNotificationSpec")
        for state in parts(events, "EventNotificationState") if events else ():
            if state.EventType == RO_SPEC_EVENTS:
                self._tells_events = state.NotificationState
        return ()

    def _start(self, spec: RoSpec, t_ns: int) -> None:
        """Listening begins with the next tick, after the answer to whoever started it."""
        spec.state = State.ACTIVE
        report = Report(spec.id, spec.report_spec or self._report_spec)
        run = self._run(spec, report)
        self._wake_ns = next(run) + t_ns
        self._active = Active(spec, report, run)

    def _run(self, spec: RoSpec, report: Report) -> Generator[int, int, None]:
        t_ns = yield 0
        self._tell(spec, False, t_ns)
        yield from Listening(spec, self._access, self._antenna, report).run(t_ns)

    def _go_on(self, active: "Active", t_ns: int) -> None:
        try:
            self._wake_ns = active.run.send(t_ns)
        except StopIteration:
            self._end(active.spec, t_ns)
            self._start_what_starts_at_once(t_ns + MS)
        self._collect(active.report)

    def _end(self, spec: RoSpec, t_ns: int) -> None:
        """Report what there is, say that it is over."""
        if self._active is None or self._active.spec is not spec:
            return
        self._active.report.ended(AT_END)
        self._collect(self._active.report)
        self._active = None
        spec.state = State.INACTIVE
        self._tell(spec, True, t_ns)

    def _start_what_starts_at_once(self, t_ns: int) -> None:
        waiting = (s for s in self._ro_specs.values() if s.state == State.INACTIVE)
        spec = next((s for s in waiting if s.starts_at_once), None)
        if spec is not None and self._active is None:
            self._start(spec, t_ns)

    def _report_now(self) -> None:
        if self._active:
            self._active.report.send()
            self._collect(self._active.report)

    def _collect(self, report: Report) -> None:
        self._out += report.ready
        report.ready.clear()

    def _tell(self, spec: RoSpec, ended: bool, t_ns: int) -> None:
        if self._tells_events:
            self._out.append(ro_spec_event(spec.id, ended, t_ns))


@dataclass(slots=True)
class Active:
    """The ROSpec that runs."""

    spec: RoSpec
    report: Report
    run: Generator[int, int, None]


def _add(specs: dict[int, Spec], spec: Spec) -> None:
    if spec.id == ALL or spec.id in specs:
        raise _Denied("A_Invalid", f"id {spec.id} is 0 or taken")
    if len(specs) >= MOST_SPECS:
        raise _Denied("M_OverflowParameter", f"{MOST_SPECS} specifications are the most")
    specs[spec.id] = spec


def _chosen(specs: dict[int, Spec], id: int) -> list[Spec]:
    """0 chooses all, also of none."""
    if id == ALL:
        return list(specs.values())
    if id not in specs:
        raise _Denied("A_Invalid", f"there is no specification {id}")
    return [specs[id]]
