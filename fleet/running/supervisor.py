"""Keeps a site running until its agents are done, whatever is killed meanwhile."""

import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from fleet.running.child import Child
from fleet.running.reaper import Reaper
from tagmap.errors import LinkError, TagmapError
from tagmap.link.router import RouterProcess

ROUTER_TRIES = 20
PAUSE_S = 0.25
HOPELESS_S = 5.0
HOPELESS_TIMES = 3
ROUTER, SERVICE = "router", "service"
ROBOT_AGENT = (sys.executable, "-m", "robot_agent.cli")


@dataclass(frozen=True, slots=True)
class Agent:
    """A robot's agent. `arguments`: of `robot-agent run`, but for what the plan says; `program`
    runs it."""

    robot: str
    arguments: tuple[str, ...]
    program: tuple[str, ...] = ROBOT_AGENT


def playing(robot: str, number: int, journal: Path, pace: tuple[str, ...] = ()) -> Agent:
    """One that plays a journal; `pace`: further arguments."""
    told = ("--source", str(journal), "--robot", robot, "--number", str(number), *pace)
    return Agent(robot, told)


def free_endpoint() -> str:
    """On loopback, where nobody listens yet."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@dataclass(frozen=True, slots=True)
class SitePlan:
    """What to run. `folder` takes logs and outboxes; `survey`: CSV for the service; `serve`: more
    arguments of it. The router is at `endpoint`; who is in `via` goes by way of another one."""

    site: str
    folder: Path
    db: Path
    agents: list[Agent]
    survey: Path | None = None
    serve: tuple[str, ...] = ()
    endpoint: str = field(default_factory=free_endpoint)
    via: Mapping[str, str] = field(default_factory=dict)

    def endpoint_of(self, name: str) -> str:
        return self.via.get(name, self.endpoint)


class AgentSummary(msgspec.Struct, frozen=True):
    """What an agent says at its end, as far as it matters here."""

    robot: str
    keyframes: int
    settled: int
    refused: int
    pending: int


class Supervisor:
    """`start`, then `tend` a few times a second until `finished`; `stop` in any case.

    Router and service are restarted when they die, agents when they are killed. Raises TagmapError
    when a child fails by itself, with the child's own reason. `tell` gets a line per event. Who is
    who: ROUTER, SERVICE, or the name of a robot.
    """

    def __init__(self, plan: SitePlan, tell: Callable[[str], None]) -> None:
        self._plan = plan
        self._tell = tell
        self.endpoint = plan.endpoint
        self._router = RouterProcess(listen=self.endpoint)
        self._service = Child(SERVICE, self._service_command(), plan.folder)
        self._agents = {a.robot: self._agent(a) for a in plan.agents}
        self._reaper = Reaper()
        self._down_until_s: dict[str, float] = {}
        self._failures = 0
        self.restarts = 0

    def start(self) -> None:
        self._reaper.start()
        self._start_router()
        self._start(self._service)
        self._tell(f"router pid={self._router.pid} service pid={self._service.pid}")
        for name, agent in self._agents.items():
            self._start(agent)
            self._tell(f"agent {name} pid={agent.pid}")

    def tend(self) -> None:
        """Look once at every process."""
        status = self._router.poll()
        if status is not None and self._may_start(ROUTER):
            self._router.stop()
            self._start_router()
            self._restarted(ROUTER, status, self._router.pid)
        status = self._service.status
        if status is not None and self._may_start(SERVICE):
            self._restart_service(status)
        for name, agent in self._agents.items():
            status = agent.status
            if status is None or status == 0:
                continue
            if status > 0:
                raise TagmapError(f"agent {name} failed: {agent.last_words()}")
            if self._may_start(name):
                self._start(agent)
                self._restarted(f"agent {name}", status, agent.pid)

    def kill(self, who: str, down_s: float) -> None:
        """As kill -9; it is started again when it has been down for so long."""
        self._down_until_s[who] = time.monotonic() + down_s
        pid = self.pid(who)
        if pid is not None:
            os.kill(pid, signal.SIGKILL)

    def pid(self, who: str) -> int | None:
        """None when it does not run."""
        if who == ROUTER:
            return self._router.pid if self._router.poll() is None else None
        child = self._service if who == SERVICE else self._agents[who]
        return child.pid if child.status is None else None

    def give_up(self) -> list[str]:
        """Have agents end that have not; they say what was not settled. Their names."""
        left = [name for name, agent in self._agents.items() if agent.status != 0]
        for name in left:
            self._agents[name].stop()
        return left

    @property
    def pids(self) -> dict[str, int]:
        """Of router and service, as far as they were started."""
        pids = {ROUTER: self._router.pid, SERVICE: self._service.pid}
        return {name: pid for name, pid in pids.items() if pid is not None}

    def require_running(self) -> None:
        """For those who do not `tend`: TagmapError when router or service has ended."""
        if self._router.poll() is not None:
            raise TagmapError("the router ended")
        if self._service.status is not None:
            raise TagmapError(f"service failed: {self._service.last_words()}")

    @property
    def finished(self) -> bool:
        """Every agent has seen everything it sent settled."""
        return all(agent.status == 0 for agent in self._agents.values())

    def summaries(self) -> list[AgentSummary]:
        """Of agents that have ended in order, in the order of the plan."""
        return [
            msgspec.json.decode(agent.out.read_bytes(), type=AgentSummary)
            for agent in self._agents.values()
            if agent.status == 0
        ]

    def stop(self) -> None:
        for agent in self._agents.values():
            agent.stop()
        self._service.stop()
        self._router.stop()
        self._reaper.stop()

    def _service_command(self) -> list[str]:
        plan = self._plan
        survey = ["--survey", str(plan.survey)] if plan.survey else []
        where = ["--connect", plan.endpoint_of(SERVICE), "--site", plan.site]
        command = [sys.executable, "-m", "tagmap.cli", "serve", *where, "--db", str(plan.db)]
        return [*command, *survey, *plan.serve]

    def _agent(self, agent: Agent) -> Child:
        plan = self._plan
        arguments = {
            "--site": plan.site,
            "--connect": plan.endpoint_of(agent.robot),
            "--outbox": str(plan.folder / f"{agent.robot}.outbox.db"),
        }
        flat = [word for pair in arguments.items() for word in pair]
        command = [*agent.program, "run", *agent.arguments, *flat, "--json"]
        return Child(f"agent-{agent.robot}", command, plan.folder)

    def _may_start(self, who: str) -> bool:
        return time.monotonic() >= self._down_until_s.get(who, 0.0)

    def _start(self, child: Child) -> None:
        if child.pid is not None:
            self._reaper.forget(child.pid)
        child.start()
        assert child.pid is not None
        self._reaper.watch(child.pid)

    def _start_router(self) -> None:
        """The port of a router that was killed can stay busy for a moment."""
        for _ in range(ROUTER_TRIES - 1):
            with suppress(LinkError):
                self._router.start()
                return
            time.sleep(PAUSE_S)
        self._router.start()

    def _restart_service(self, status: int) -> None:
        failed_early = status > 0 and time.monotonic() - self._service.started_s < HOPELESS_S
        self._failures = self._failures + 1 if failed_early else 0
        if self._failures >= HOPELESS_TIMES:
            raise TagmapError(f"service failed: {self._service.last_words()}")
        self._start(self._service)
        self._restarted(SERVICE, status, self._service.pid)

    def _restarted(self, what: str, status: int, pid: int | None) -> None:
        self.restarts += 1
        self._tell(f"{what} ended with status {status}, started again pid={pid}")
