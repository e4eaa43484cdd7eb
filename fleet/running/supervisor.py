"""Keeps a site running until its agents are done, whatever is killed meanwhile."""

import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True)
class Agent:
    """A robot and the journal that it plays; `pace`: further arguments of its agent."""

    robot: str
    number: int
    journal: Path
    pace: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SitePlan:
    """What to run. `folder` takes logs and outboxes; `survey`: CSV for the service."""

    site: str
    folder: Path
    db: Path
    agents: list[Agent]
    survey: Path | None = None


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
    when a child fails by itself, with the child's own reason. `tell` gets a line per event.
    """

    def __init__(self, plan: SitePlan, tell: Callable[[str], None]) -> None:
        self._plan = plan
        self._tell = tell
        self.endpoint = f"tcp/127.0.0.1:{_free_port()}"
        self._router = RouterProcess(listen=self.endpoint)
        self._service = Child("service", self._service_command(), plan.folder)
        self._agents = {a.robot: self._agent(a) for a in plan.agents}
        self._reaper = Reaper()
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
        if (status := self._router.poll()) is not None:
            self._router.stop()
            self._start_router()
            self._restarted("router", status, self._router.pid)
        if (status := self._service.status) is not None:
            self._restart_service(status)
        for name, agent in self._agents.items():
            if (status := agent.status) is not None and status != 0:
                if status > 0:
                    raise TagmapError(f"agent {name} failed: {agent.last_words()}")
                self._start(agent)
                self._restarted(f"agent {name}", status, agent.pid)

    @property
    def finished(self) -> bool:
        """Every agent has seen everything it sent settled."""
        return all(agent.status == 0 for agent in self._agents.values())

    def summaries(self) -> list[AgentSummary]:
        """Of finished agents, in the order of the plan."""
        return [
            msgspec.json.decode(agent.out.read_bytes(), type=AgentSummary)
            for agent in self._agents.values()
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
        where = ["--connect", self.endpoint, "--site", plan.site]
        return [sys.executable, "-m", "tagmap.cli", "serve", *where, "--db", str(plan.db), *survey]

    def _agent(self, agent: Agent) -> Child:
        arguments = {
            "--source": str(agent.journal),
            "--robot": agent.robot,
            "--number": str(agent.number),
            "--site": self._plan.site,
            "--connect": self.endpoint,
            "--outbox": str(self._plan.folder / f"{agent.robot}.outbox.db"),
        }
        flat = [word for pair in arguments.items() for word in pair]
        command = [sys.executable, "-m", "robot_agent.cli", "run", *flat, *agent.pace, "--json"]
        return Child(f"agent-{agent.robot}", command, self._plan.folder)

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
        self._restarted("service", status, self._service.pid)

    def _restarted(self, what: str, status: int, pid: int | None) -> None:
        self.restarts += 1
        self._tell(f"{what} ended with status {status}, started again pid={pid}")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
